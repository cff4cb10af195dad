"""How a training ended, and what is left of its loss: the sensor's noise, the data, the optimiser or the network.

Judged by the losses alone, in this order:
noise        the losses on validation and unseen indenters are within CLOSE of what the sensor's own trials differ by
optimiser    the best validation loss still fell by more than STILL over the last quarter of the epochs: train for longer
data         the loss on validation maps, or on unseen indenters, is more than GAP times the training loss: the network reads what
             it has seen and not the rest, so that more maps would bring the two together (validation maps alone are of indenters
             that training saw)
network      neither: this network, from these weights and with this rate, fits no better
"""

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import pandas as pd

CLOSE, STILL, GAP = 1.25, 0.02, 1.5
COLUMNS = ["learning_rate", "best_epoch", "train_loss", "validation_loss", "unseen_loss", "late_fall", "remains"]


def convergence(history: "pd.DataFrame", *, noise_loss: float = np.nan, unseen_loss: float = np.nan) -> dict[str, Any]:
    """COLUMNS of a training's history.csv; losses in counts, summed over the taxels, at the best epoch.

    late_fall: share by which the best validation loss fell over the last quarter of the epochs
    noise_loss: the same loss of the sensor's trials against each other; nan where it was read once
    unseen_loss: the same of the best network on indenters that training never saw; nan where it is not known
    """
    best = history.loc[history.validation_loss.idxmin()]
    early = history.validation_loss.iloc[:max(1, (3 * len(history)) // 4)].min()
    fall = 1.0 - best.validation_loss / early
    test_loss = np.fmax(best.validation_loss, unseen_loss)
    if test_loss <= CLOSE * noise_loss:
        remains = "noise"
    elif fall > STILL or len(history) < 4:
        remains = "optimiser"
    else:
        remains = "data" if test_loss > GAP * best.train_loss else "network"
    return {"learning_rate": history.learning_rate.iloc[0], "best_epoch": int(best.epoch), "train_loss": best.train_loss,
            "validation_loss": best.validation_loss, "unseen_loss": unseen_loss, "late_fall": fall, "remains": remains}
