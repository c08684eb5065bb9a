"""The whole camera map stage against inference alone: python camera.py TILEFOLD CARD CITY OUT.json [ROUNDS]

CITY is a folder of `tilefold simulate --profile camera`. In turns, in one thread each: `tilefold run` from logs
to a committed version, and python's onnxruntime on the same pictures as tensors that are ready. Compared are
frames per second of processor time, as other work on the machine does not change it much.
"""

import json
import os
import resource
import shutil
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

import cv2
import numpy as np
import onnxruntime
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory as Protobuf
from mcap_ros2.decoder import DecoderFactory as Ros2

# Tensors that are held; they are run through again and again.
HELD = 64


def whole(tilefold, card, city):
    """Frames and processor seconds of a job."""
    folder = Path(tempfile.mkdtemp())
    store = folder / "store"
    subprocess.run([tilefold, "init", store, "--map", city / "before.osm"], check=True, capture_output=True)
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    command = [tilefold, "--format", "json", "run", store, city / "logs", "--detector", card]
    done = subprocess.run(command, env=os.environ | {"RAYON_NUM_THREADS": "1"}, check=True, capture_output=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    shutil.rmtree(folder)
    stages = {stage["stage"]: stage for stage in json.loads(done.stdout)["stages"]}
    return stages["detect"]["items"], after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, stages


def tensors(card, city):
    size = (card["input"]["width_px"], card["input"]["height_px"])
    ready = []
    for log in sorted((city / "logs").glob("*.mcap")):
        with log.open("rb") as file:
            reader = make_reader(file, decoder_factories=[Ros2(), Protobuf()])
            for number, (_, _, _, image) in enumerate(reader.iter_decoded_messages(topics=["/camera/image/compressed"])):
                if number % 16 == 0 and len(ready) < HELD:
                    picture = cv2.imdecode(np.frombuffer(bytes(image.data), np.uint8), 1)
                    rgb = cv2.resize(picture, size)[:, :, ::-1].transpose(2, 0, 1)[None]
                    ready.append(np.ascontiguousarray(rgb, np.float32) / 255.0)
    return ready


def bare(session, name, ready, frames):
    before = resource.getrusage(resource.RUSAGE_SELF)
    for number in range(frames):
        session.run(None, {name: ready[number % len(ready)]})
    after = resource.getrusage(resource.RUSAGE_SELF)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main():
    tilefold, card_path, city, out = sys.argv[1:5]
    rounds = int(sys.argv[5]) if len(sys.argv) > 5 else 3
    card_path, city = Path(card_path), Path(city)
    card = tomllib.loads(card_path.read_text())
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    session = onnxruntime.InferenceSession(card_path.parent / card["model"], options)
    ready = tensors(card, city)
    results = []
    for _ in range(rounds):
        frames, whole_s, stages = whole(tilefold, card_path, city)
        bare_s = bare(session, card["input"]["name"], ready, frames)
        results.append({"frames": frames, "whole_cpu_s": whole_s, "bare_cpu_s": bare_s, "share": bare_s / whole_s, "stages": stages})
        print(f"{frames} frames: {1e3 * whole_s / frames:.1f} ms each, inference alone {1e3 * bare_s / frames:.1f} ms: {bare_s / whole_s:.2f}")
    Path(out).write_text(json.dumps({"model": card["name"], "onnxruntime": onnxruntime.__version__, "rounds": results}, indent=1) + "\n")


if __name__ == "__main__":
    main()
