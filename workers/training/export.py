"""Writes weights as one ONNX file: python export.py WEIGHTS OUT.onnx"""

import sys

import torch

from network import Exported, Network


def main():
    weights, out = sys.argv[1:3]
    network = Network()
    if weights != "random":
        network.load_state_dict(torch.load(weights, weights_only=True)["network"])
    exported = Exported(network).eval()
    torch.onnx.export(
        exported,
        (torch.zeros(1, 3, 360, 640),),
        out,
        input_names=["image"],
        output_names=["lines", "boxes"],
        opset_version=17,
        dynamo=False,
    )


if __name__ == "__main__":
    main()
