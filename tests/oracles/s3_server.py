"""An S3 server with one bucket and one user, for `cargo xtask s3-test`.

Prints one line (endpoint, key, secret) and serves until its standard input ends. Unlike `moto_server` it
checks signatures, and it answers one request at a time: moto looks and puts in two steps, so that its threads
would let two writers create the same object, which no S3 does.
"""

import json
import os
import sys
import threading

from moto import settings
from moto.iam.models import iam_backends
from moto.moto_server.werkzeug_app import DomainDispatcherApplication, MotoRequestHandler, create_backend_app
from moto.s3.models import s3_backends
from werkzeug.serving import make_server

BUCKET = "maps"
ACCOUNT = "123456789012"
ALL_OF_S3 = {"Version": "2012-10-17", "Statement": [{"Effect": "Allow", "Action": "s3:*", "Resource": "*"}]}


def user_with_key():
    """The one user that may use buckets."""
    iam = iam_backends[ACCOUNT]["aws"]
    iam.create_user(region_name="us-east-1", user_name="tilefold")
    iam.put_user_policy("tilefold", "s3", json.dumps(ALL_OF_S3))
    return iam.create_access_key("tilefold")


class Quiet(MotoRequestHandler):
    def log(self, *_):
        pass


def main():
    key = user_with_key()
    s3_backends[ACCOUNT]["aws"].create_bucket(BUCKET, "us-east-1")
    settings.INITIAL_NO_AUTH_ACTION_COUNT = 0.0
    app = DomainDispatcherApplication(create_backend_app)
    server = make_server("127.0.0.1", 0, app, threaded=False, request_handler=Quiet)
    endpoint = f"http://127.0.0.1:{server.server_port}"
    print(endpoint, key.access_key_id, key.secret_access_key, flush=True)
    threading.Thread(target=lambda: (sys.stdin.read(), os._exit(0)), daemon=True).start()
    server.serve_forever()


main()
