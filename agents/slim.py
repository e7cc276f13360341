"""A trained model without what only further training needs: to be shipped."""

from operator import attrgetter
from pathlib import Path

from rss_shield.agents.load import algorithm_in


def write_slim(model: Path, out: Path) -> None:
    """Save a model of stable-baselines3 without the moments of its optimisers, two thirds of its file.

    It acts as before, and is loaded as any other. Training it further begins with fresh optimisers.

    Args:
      model: its .zip file.
      out: the file to write; its folder is made.
    """
    loaded = algorithm_in(model).load(model, device="cpu")
    names, _ = loaded._get_torch_save_params()
    for name in names:
        if name.endswith("optimizer"):
            attrgetter(name)(loaded).state.clear()
    out.parent.mkdir(parents=True, exist_ok=True)
    loaded.save(out)
