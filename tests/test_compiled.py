"""Where compiled kernels are kept, on machines with and without a place for them."""

from __future__ import annotations

import logging
import os
import stat
from pathlib import Path

import numpy as np
import pytest

from magfem import compiled

pytestmark = pytest.mark.skipif(not hasattr(os, "getuid"), reason="rights as on Unix")


@pytest.fixture
def homeless(tmp_path, monkeypatch):
    """No HOME, a user whom the system does not know, and a temporary directory of our own."""

    def no_home():
        raise RuntimeError("Could not determine home directory.")

    for name in ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(Path, "home", no_home)
    monkeypatch.setattr(compiled.tempfile, "gettempdir", lambda: str(tmp_path))
    compiled.cache_folder.cache_clear()
    yield tmp_path / f"magfem-{os.getuid()}"
    compiled.cache_folder.cache_clear()


def double(x):
    return 2 * x


def test_without_a_home_a_private_temporary_folder_serves(homeless):
    assert compiled.cache_folder().parent == homeless
    assert stat.S_IMODE(homeless.stat().st_mode) == 0o700 and homeless.stat().st_uid == os.getuid()


def others_may_write(folder, elsewhere):
    folder.mkdir()
    folder.chmod(0o777)


def a_link(folder, elsewhere):
    elsewhere.mkdir(mode=0o700)
    folder.symlink_to(elsewhere)


def a_file(folder, elsewhere):
    folder.write_text("")


@pytest.mark.parametrize("prepare", [others_may_write, a_link, a_file])
def test_a_folder_that_others_may_write_is_not_used(prepare, homeless, tmp_path, caplog):
    prepare(homeless, tmp_path / "elsewhere")
    with caplog.at_level(logging.WARNING, logger="magfem"):
        kernels = [compiled.kernel(double), compiled.kernel(double)]
    assert compiled.cache_folder() is None
    assert len(caplog.records) == 1 and "compiled anew in every process" in caplog.text
    assert all(kernel(np.float64(1.5)) == 3 for kernel in kernels)


def test_a_folder_of_another_user_is_not_used(homeless, monkeypatch):
    homeless.mkdir(mode=0o700)
    user = os.getuid()
    homeless.rename(homeless.with_name(f"magfem-{user + 1}"))
    monkeypatch.setattr(os, "getuid", lambda: user + 1)
    assert compiled.cache_folder() is None
