"""tqdm progress bars, in terminals and notebooks."""

from collections.abc import Callable


def bar() -> Callable[[float, float], None]:
    """Return a function of done and total that updates a new progress bar."""
    try:
        from tqdm.auto import tqdm
    except ImportError as error:
        raise ImportError(
            "progress=True shows a bar of tqdm, which is not installed: install it, or give a function of done and total"
        ) from error
    shown = tqdm(total=1.0, bar_format="{l_bar}{bar}| {elapsed}<{remaining}")

    def move(done: float, total: float) -> None:
        shown.total = total
        shown.n = min(done, total)
        shown.refresh()
        if done >= total:
            shown.close()

    return move
