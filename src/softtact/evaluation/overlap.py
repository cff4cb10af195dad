"""Do the network and the sensor feel the contact in the same place? Overlap of the two contact patches on the taxels."""

import numpy as np

SHARE = 0.1             # of the reading's largest count, from which on a taxel belongs to the patch
FLOOR_COUNTS = 30.0     # at least: some four standard deviations of the virtual sensor's offsets and noise together


def contact_patch_overlap(predicted: np.ndarray, measured: np.ndarray, *, share: float = SHARE,
                          floor_counts: float = FLOOR_COUNTS) -> np.ndarray:
    """Intersection over union (n,) of the contact patches of tactile maps (n, row, column) in counts.

    A patch is the taxels above a threshold: `share` of the *measured* map's maximum, but no less than `floor_counts`. Both
    maps are cut at the same counts, so a prediction of the right shape that is far too faint loses its patch. Two empty
    patches agree: 1.
    """
    threshold = np.maximum(share * measured.max(axis=(1, 2), keepdims=True), floor_counts)
    ours, theirs = predicted > threshold, measured > threshold
    both, either = ((ours & theirs).sum(axis=(1, 2)), (ours | theirs).sum(axis=(1, 2)))
    return np.where(either == 0, 1.0, both / np.maximum(either, 1))
