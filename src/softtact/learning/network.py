"""The network: a deformation map in, 28 tactile counts out. The paper's section 3.3.2, layer by layer.

Three 2 x 2 convolutions (80, 95, 120 filters, no padding), each followed by 2 x 2 max-pooling with stride 1; a hidden
layer of 570 neurons with ReLU; 28 linear outputs. 94.3 million weights, nearly all between the last pool and the
hidden layer. The paper is silent on the convolutions' activation: ReLU by default.

Inside, maps and counts are divided by two constants of the training set, so that both are of order one. The constants
are stored with the weights: the network's face is in mm and counts.
"""

import torch
from torch import nn

import softtact
from softtact.errors import InputError
from softtact.files import atomic_path


class TactileNetwork(nn.Module):
    """Deformation maps (n, y, x) in mm to tactile maps (n, row, column) in counts."""

    def __init__(self, *, map_shape, taxels, filters=(80, 95, 120), dense=570, activation="relu",
                 map_scale_mm=1.0, count_scale=1.0):
        super().__init__()
        self.options = {"map_shape": list(map_shape), "taxels": list(taxels), "filters": list(filters),
                        "dense": dense, "activation": activation}
        channels = [1, *filters]
        self.features = nn.Sequential(*[
            layer for n_in, n_out in zip(channels, filters, strict=False) for layer in block(n_in, n_out, activation)])
        lost = 2 * len(filters)  # a 2 x 2 convolution and a 2 x 2 pool with stride 1 each take one row and one column
        height, width = (side - lost for side in map_shape)
        self.hidden = nn.Linear(filters[-1] * height * width, dense)
        self.output = nn.Linear(dense, taxels[0] * taxels[1])
        self.register_buffer("map_scale_mm", torch.tensor(float(map_scale_mm)))
        self.register_buffer("count_scale", torch.tensor(float(count_scale)))

    def forward(self, maps_mm):                                      # (n, 57, 33) mm
        x = self.features(maps_mm[:, None] / self.map_scale_mm)      # (n, 120, 51, 27)
        x = torch.relu(self.hidden(x.flatten(1)))                    # (n, 570)
        x = self.output(x) * self.count_scale                        # (n, 28) counts
        return x.unflatten(1, self.options["taxels"])                # (n, 7, 4) counts


def block(n_in, n_out, activation):
    """Convolution, its activation, and a pool: each (n, c, h, w) loses two rows and two columns."""
    middle = {"relu": nn.ReLU, "linear": nn.Identity}[activation]
    return nn.Conv2d(n_in, n_out, kernel_size=2), middle(), nn.MaxPool2d(kernel_size=2, stride=1)


def summed_l1(predicted, measured):
    """The paper's equation 1: |difference| summed over a map's taxels, in counts; here its mean over the maps (n, 7, 4)."""
    return (predicted - measured).abs().sum(dim=(1, 2)).mean()


def predict(network, maps_mm, *, batch=64):
    """Tactile maps (n, row, column) in counts, as numpy, of deformation maps (n, y, x) in mm."""
    device = next(network.parameters()).device
    maps_mm = torch.as_tensor(maps_mm, dtype=torch.float32)
    network.eval()
    with torch.inference_mode():
        return torch.cat([network(part.to(device)).cpu() for part in maps_mm.split(batch)]).numpy()


def save_network(path, network, *, facts):
    """Write weights, options and `facts` (plain values: model, seed, epoch, ...); the same network gives the same bytes."""
    weights = {name: tensor.detach().cpu() for name, tensor in network.state_dict().items()}
    save(path, {"options": network.options, "weights": weights,
                "facts": {**facts, "softtact_version": softtact.__version__}})


def load_network(path):
    """(network, facts) of a file that `save_network` wrote, on the CPU; only tensors and plain values are accepted."""
    stored = load(path)
    network = TactileNetwork(**stored["options"])
    network.load_state_dict(stored["weights"])
    return network.eval(), stored["facts"]


def save(path, stored):
    """Write a dictionary of tensors and plain values, whole or not at all."""
    with atomic_path(path) as temporary, open(temporary, "wb") as file:
        torch.save(stored, file)  # into an open file: given a path, torch writes the file's name into the bytes


def load(path):
    """Read what `save` wrote; a file that holds anything but tensors and plain values is refused."""
    try:
        return torch.load(path, map_location="cpu", weights_only=True)
    except FileNotFoundError:
        raise InputError(f"{path}: there is no such file; train the network first.") from None
    except Exception as error:  # torch raises whatever its unpickler met
        reason = next(iter(str(error).splitlines()), type(error).__name__)
        raise InputError(f"{path}: not a network's file ({reason}); delete it and train again.") from None
