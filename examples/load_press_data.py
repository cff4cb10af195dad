"""Load a data set of `softtact dataset` in torch, in batches.

    softtact dataset part.stl --unit mm --presses 100 --out data.h5
    python examples/load_press_data.py data.h5

A sample is a press at one force: map (finger, y, x) in mm, taxels (finger, row, column) in counts, force in N, object's number.
Presses that failed are left out. Needs the extra `learn`.
"""

import argparse
from pathlib import Path

import h5py
import torch


class PressDataset(torch.utils.data.Dataset):
    """The samples of an HDF5 file, read on demand; each worker of a loader opens the file."""

    def __init__(self, path):
        self.path, self._file = path, None
        with h5py.File(path, "r") as file:
            self._presses = [number for number, status in enumerate(file["status"][:]) if status == 1]
            self._forces = file["force_n"][:]

    def __len__(self):
        return len(self._presses) * len(self._forces)

    def __getitem__(self, index):
        if index >= len(self):
            raise IndexError(index)
        self._file = self._file or h5py.File(self.path, "r")
        press, step = self._presses[index // len(self._forces)], index % len(self._forces)
        return {"deformation_mm": torch.from_numpy(self._file["deformation_map_mm"][press, step]),
                "tactile": torch.from_numpy(self._file["tactile_map"][press, step].astype("float32")),
                "force_n": torch.tensor(self._forces[step], dtype=torch.float32), "object": int(self._file["object"][press])}


def main(arguments=None):
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("data", type=Path, help="HDF5 file of softtact dataset")
    parser.add_argument("--batch", type=int, default=32)
    options = parser.parse_args(arguments)
    samples = PressDataset(options.data)
    for batch in torch.utils.data.DataLoader(samples, batch_size=options.batch, shuffle=True):
        print(f"maps {tuple(batch['deformation_mm'].shape)} up to {batch['deformation_mm'].max():.3f} mm, taxels "
              f"{tuple(batch['tactile'].shape)} up to {batch['tactile'].max():.0f} counts")
    return samples


if __name__ == "__main__":
    main()
