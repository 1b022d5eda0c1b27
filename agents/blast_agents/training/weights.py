"""Archives of stable-baselines3: written whole, and read without running code.

Such an archive holds weights and optimiser as tensors, and other values pickled. Only the tensors
are read here.
"""

from collections.abc import Mapping
from io import BytesIO
from pathlib import Path
from typing import Any, Final
from zipfile import ZIP_STORED, BadZipFile, ZipFile

import torch
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.save_util import load_from_zip_file
from torch import nn

from blast_env.errors import BlastEnvError
from blast_env.files import read_regular, write_atomically

_MOST_BYTES: Final = 1_000_000_000

Parameters = dict[str, Any]
"""States of `"policy"` and `"policy.optimizer"`, by these names."""


def write_model(model: BaseAlgorithm, path: Path) -> None:
    """Write a model as an archive of stable-baselines3, whole or not at all.

    Raises:
        BlastEnvError: If the file cannot be written.
    """
    # torch raises errors of another type if the device is full.
    buffer = BytesIO()
    model.save(buffer, exclude=("_last_obs", "_last_original_obs"))
    with write_atomically(path) as temporary:
        temporary.write_bytes(buffer.getbuffer())


def read_parameters(path: Path) -> Parameters:
    """Return the tensors of an archive of stable-baselines3.

    Raises:
        BlastEnvError: If the file does not exist, is damaged or has no policy.
    """
    try:
        content = BytesIO(read_regular(path, _MOST_BYTES))
    except BlastEnvError as error:
        raise BlastEnvError(f"{path}: {error}") from error
    try:
        check_zip(content)
        _, parameters, _ = load_from_zip_file(content, load_data=False, device="cpu")
        _check_tensors(parameters)
        if "policy" not in parameters:
            raise BadZipFile("it has no policy.pth")
    # torch reports a faulty file by exceptions of many types.
    except Exception as error:
        first_line = str(error).partition("\n")[0]
        raise BlastEnvError(
            f"{path}: is damaged, or no archive of stable-baselines3: {first_line}"
        ) from error
    return parameters


def load_policy(policy: nn.Module, parameters: Mapping[str, Any], place: Path) -> None:
    """Load the weights of an archive into a policy.

    Args:
        policy: The policy.
        parameters: The tensors of the archive.
        place: The archive, for the error.

    Raises:
        BlastEnvError: If they do not fit the policy or are not finite.
    """
    try:
        policy.load_state_dict(parameters["policy"])
    # torch reports a mismatch by exceptions of many types.
    except Exception as error:
        raise _mismatch(error, place) from error
    _check_finite(policy, place)


def load_model(model: BaseAlgorithm, parameters: Parameters, place: Path) -> None:
    """Load weights and optimiser of an archive into a model.

    Args:
        model: The model.
        parameters: The tensors of the archive.
        place: The archive, for the error.

    Raises:
        BlastEnvError: If they do not fit the model, or the weights are not finite.
    """
    try:
        model.set_parameters(parameters, device="cpu")
    except Exception as error:
        raise _mismatch(error, place) from error
    _check_finite(model.policy, place)


def _mismatch(error: Exception, place: Path) -> BlastEnvError:
    problem = " ".join(str(error).split())
    return BlastEnvError(f"{place}: weights and configuration differ: {problem}")


def _check_finite(policy: nn.Module, place: Path) -> None:
    for name, value in policy.state_dict().items():
        if not torch.isfinite(value).all():
            raise BlastEnvError(f"{place}: the weights {name} are not finite")


def check_zip(content: BytesIO) -> None:
    """Refuse compressed members, which may expand to any size, and wrong checksums.

    Members that are archives themselves, as those of torch, are checked, too.

    Raises:
        BadZipFile: If it is no such archive.
    """
    with ZipFile(content) as archive:
        for member in archive.infolist():
            if member.compress_type != ZIP_STORED:
                raise BadZipFile(f"{member.filename} is compressed")
        wrong = archive.testzip()
        if wrong is not None:
            raise BadZipFile(f"{wrong} has a wrong checksum")
        for name in archive.namelist():
            if name.endswith(".pth"):
                check_zip(BytesIO(archive.read(name)))
    content.seek(0)


def _check_tensors(content: Any) -> None:
    """Refuse tensors larger than their data in the file."""
    if isinstance(content, torch.Tensor):
        if content.numel() * content.element_size() > content.untyped_storage().nbytes():
            raise ValueError(f"a tensor of {tuple(content.shape)} is not in the file")
    elif isinstance(content, dict):
        for value in content.values():
            _check_tensors(value)
    elif isinstance(content, list | tuple):
        for value in content:
            _check_tensors(value)
