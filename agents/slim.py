"""A trained model without what only further training needs, in half precision: to be shipped."""

import io
import zipfile
from operator import attrgetter
from pathlib import Path

import torch

from rss_shield.agents.load import algorithm_in

WEIGHTS = "policy.pth"  # in the files of stable-baselines3


def write_slim(model: Path, out: Path) -> None:
    """Save a model of stable-baselines3 in a sixth to a third of its space.

    It is loaded as any other. Its optimisers have lost their moments, so training it further begins with fresh ones,
    and its weights are rounded to half precision: by one part in 2000, which turns a greedy action into another only
    where two are as good as equal.

    Args:
      model: its .zip file.
      out: the file to write.
    """
    loaded = algorithm_in(model).load(model, device="cpu")
    names, _ = loaded._get_torch_save_params()
    for name in names:
        if name.endswith("optimizer"):
            attrgetter(name)(loaded).state.clear()
    whole = io.BytesIO()
    loaded.save(whole)
    with zipfile.ZipFile(whole) as parts, zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as slim:
        for part in parts.infolist():
            content = parts.read(part)
            slim.writestr(part.filename, _halved(content) if part.filename == WEIGHTS else content)


def _halved(weights: bytes) -> bytes:
    """Saved tensors, in half precision."""
    tensors = torch.load(io.BytesIO(weights), map_location="cpu", weights_only=True)
    halved = {name: tensor.half() if tensor.is_floating_point() else tensor for name, tensor in tensors.items()}
    saved = io.BytesIO()
    torch.save(halved, saved)
    return saved.getvalue()
