"""The network: a small residual encoder, features joined at stride 8, two heads of dense cells.

Outputs are as the model card says: `lines` [n, 4 + 7 + 3 + 8, h, w] and `boxes` [n, 14 + 4 + 8, h, w].
"""

import torch
from torch import nn
from torch.nn import functional as F

from pictures import BOXES, COLORS, MARKINGS

EMBEDDING = 8
LINES = 4 + len(MARKINGS) + len(COLORS) + EMBEDDING
BOX_CHANNELS = len(BOXES) + 4 + EMBEDDING
MEAN, SPREAD = (0.42, 0.43, 0.44), (0.25, 0.25, 0.26)


def convolution(into, out, size=3, stride=1, dilation=1):
    padding = dilation * (size // 2)
    return nn.Sequential(
        nn.Conv2d(into, out, size, stride, padding, dilation, bias=False), nn.BatchNorm2d(out), nn.ReLU(True)
    )


class Residual(nn.Module):
    def __init__(self, channels, dilation=1):
        super().__init__()
        self.first = convolution(channels, channels, dilation=dilation)
        self.second = nn.Sequential(
            nn.Conv2d(channels, channels, 3, padding=1, bias=False), nn.BatchNorm2d(channels)
        )

    def forward(self, x):
        return F.relu(x + self.second(self.first(x)))


class Network(nn.Module):
    def __init__(self, widths=(16, 32, 64, 96, 128)):
        super().__init__()
        a, b, c, d, e = widths
        self.register_buffer("mean", torch.tensor(MEAN).view(1, 3, 1, 1))
        self.register_buffer("spread", torch.tensor(SPREAD).view(1, 3, 1, 1))
        self.to_4 = nn.Sequential(convolution(3, a, stride=2), convolution(a, b, stride=2), convolution(b, b))
        self.to_8 = nn.Sequential(convolution(b, c, stride=2), Residual(c), Residual(c))
        self.to_16 = nn.Sequential(convolution(c, d, stride=2), Residual(d), Residual(d))
        self.to_32 = nn.Sequential(convolution(d, e, stride=2), Residual(e), Residual(e, 2), Residual(e, 4))
        self.from_32, self.at_16 = convolution(e, c, 1), convolution(d, c, 1)
        self.from_16, self.join = convolution(c, c), convolution(c, c)
        self.lines = nn.Sequential(convolution(c, c), nn.Conv2d(c, LINES, 1))
        self.boxes = nn.Sequential(convolution(c, c), nn.Conv2d(c, BOX_CHANNELS, 1))
        # Most cells hold nothing: begin there.
        nn.init.constant_(self.lines[1].bias[:1], -3.5)
        nn.init.constant_(self.boxes[1].bias[: len(BOXES)], -5.0)

    def forward(self, image):
        """Raw outputs: logits, and the logarithms of the boxes' sides."""
        x8 = self.to_8(self.to_4((image - self.mean) / self.spread))
        x16 = self.to_16(x8)
        x32 = self.to_32(x16)
        size_8, size_16 = x8.shape[2:], x16.shape[2:]
        x16 = self.at_16(x16) + F.interpolate(self.from_32(x32), size=size_16, mode="bilinear")
        x = self.join(x8 + F.interpolate(self.from_16(x16), size=size_8, mode="bilinear"))
        return self.lines(x), self.boxes(x)


class Exported(nn.Module):
    """The network with the card's outputs: probabilities, and sides in cells."""

    def __init__(self, network):
        super().__init__()
        self.network = network

    def forward(self, image):
        lines, boxes = self.network(image)
        kinds = len(BOXES)
        lines = torch.cat([lines[:, :1].sigmoid(), lines[:, 1:]], 1)
        sides = boxes[:, kinds : kinds + 4].clamp(-6, 6).exp()
        boxes = torch.cat([boxes[:, :kinds].sigmoid(), sides, boxes[:, kinds + 4 :]], 1)
        return lines, boxes
