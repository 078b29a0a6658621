"""Arrays of any library as NumPy's. NumPy is imported at the first use, as `import strivec` shall be quick."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from numpy.typing import NDArray


def to_numpy(array: Any, dtype: str) -> NDArray:
    """`array` as a NumPy array of `dtype`: one of NumPy, a list, or anything of the array or the DLPack protocol, such as a
    tensor of PyTorch on any device that can be detached and moved. Copies only what it must."""
    import numpy as np

    if hasattr(array, "detach"):
        # A tensor that takes part in gradients, or is on another device, hands out no memory.
        array = array.detach()
        if hasattr(array, "cpu"):
            array = array.cpu()
    if hasattr(array, "__dlpack__") and not isinstance(array, np.ndarray):
        array = np.from_dlpack(array)
    return np.ascontiguousarray(array, dtype=dtype)
