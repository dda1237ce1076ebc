"""The spectrum of a picture's error: python3 bench/spectrum.py REFERENCE.exr PICTURE.exr ...

For each picture, the power of the relative error of the luminance, (picture - reference) / (reference + 0.02),
by wavelength in pixels: the mean of the power spectral density over the octave, so that white noise has the same
value in all octaves (its variance). Blotches as wide as the region of a record show as more power in the octaves
from 16 to 64 pixels than in that of 2 to 4. Relative errors beyond 1 count as 1: specks are judged elsewhere.

Needs NumPy and OpenEXR (pip install numpy OpenEXR).
"""

import sys

import numpy
import OpenEXR

OCTAVES = [2, 4, 8, 16, 32, 64, 128]


def luminance(path):
    channels = OpenEXR.File(path).channels()
    for name in ("RGB", "RGBA"):
        if name in channels:
            return numpy.asarray(channels[name].pixels, numpy.float64)[..., :3] @ [0.2126, 0.7152, 0.0722]
    return sum(weight * channels[c].pixels.astype(numpy.float64) for c, weight in zip("RGB", [0.2126, 0.7152, 0.0722]))


def spectrum(error):
    """Mean power spectral density of the error in each octave of wavelengths."""
    height, width = error.shape
    window = numpy.outer(numpy.hanning(height), numpy.hanning(width))
    power = abs(numpy.fft.fft2(error * window)) ** 2 / (window**2).sum()
    frequency = numpy.hypot(numpy.fft.fftfreq(height)[:, None], numpy.fft.fftfreq(width)[None, :])
    bands = [(frequency > 1 / long) & (frequency <= 1 / short) for short, long in zip(OCTAVES, OCTAVES[1:])]
    return [power[band].mean() for band in bands]


def main():
    reference = luminance(sys.argv[1])
    print("pixels per wave", *(f"{a:>4} to {b:<3}" for a, b in zip(OCTAVES, OCTAVES[1:])), sep="  ")
    for path in sys.argv[2:]:
        error = (luminance(path) - reference) / (reference + 0.02)
        print(path, *(f"{power:11.2e}" for power in spectrum(numpy.clip(error, -1, 1))))


main()
