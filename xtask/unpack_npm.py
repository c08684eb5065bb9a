"""Takes files out of a package as `npm pack` left it, if its hash is the one that is pinned.

usage: unpack_npm.py PACKAGE.tgz SHA512_BASE64 FOLDER FILE...
"""

import base64
import hashlib
import os
import sys
import tarfile


def main(package: str, pinned: str, folder: str, *files: str) -> None:
    with open(package, "rb") as opened:
        found = base64.b64encode(hashlib.sha512(opened.read()).digest()).decode()
    if found != pinned:
        sys.exit(f"{package} has the SHA-512 {found}, but {pinned} is pinned: it is not used")
    with tarfile.open(package) as archive:
        contents = {name: archive.extractfile(f"package/{name}").read() for name in files}
    for name, content in contents.items():
        path = os.path.join(folder, os.path.basename(name))
        with open(path + ".part", "wb") as out:
            out.write(content)
        # Renamed last: a file that is there is whole.
        os.replace(path + ".part", path)


main(*sys.argv[1:])
