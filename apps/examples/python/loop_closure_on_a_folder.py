#!/usr/bin/env python3
"""Loop closure alone: reads the images of a folder in order, says where the camera was before, and draws what the
ensemble believed while it went on (matplotlib; without it there is no picture).

usage: loop_closure_on_a_folder.py DIR [PICTURE.png]
"""
import sys

import numpy as np

import tutti


def main():
    if len(sys.argv) not in (2, 3):
        sys.exit(__doc__)
    detector = tutti.LoopDetector(keep_posterior=True)  # SURF, SIFT and ORB, and one Bayes filter on all of them
    results = []
    for frame in tutti.Dataset(sys.argv[1], type="images"):  # or cv2.imread: grey, or colour as it comes
        result = detector.detect(frame.image)
        results.append(result)
        if result.accepted:
            print(f"image {result.query} is where image {result.candidate} was (probability {result.probability:.3f}, "
                  f"{result.verification.inliers} of {result.verification.matches} matches fit)")
        elif result.proposed:
            print(f"image {result.query}: no loop with {result.candidate}: {result.reason}")
    print(f"{len(results)} images, {sum(result.accepted for result in results)} loops")
    if len(sys.argv) > 2:
        draw(results, sys.argv[2])


def draw(results, file):
    try:
        import matplotlib
    except ImportError:
        print("no picture: there is no matplotlib (Debian: python3-matplotlib)")
        return
    matplotlib.use("Agg")
    from matplotlib import pyplot
    posterior = np.full((len(results), len(results)), np.nan)
    for result in results:
        posterior[result.locations, result.query] = result.posteriors
    pyplot.figure(figsize=(6, 5))
    pyplot.imshow(posterior, origin="lower", cmap="magma_r", vmin=0, vmax=1)
    pyplot.colorbar(label="posterior")
    accepted = [result for result in results if result.accepted]
    pyplot.plot([r.query for r in accepted], [r.candidate for r in accepted], "c.", label="accepted loops")
    pyplot.xlabel("image")
    pyplot.ylabel("place")
    pyplot.legend(loc="upper left")
    pyplot.savefig(file, dpi=150)
    print(f"picture: {file}")


if __name__ == "__main__":
    main()
