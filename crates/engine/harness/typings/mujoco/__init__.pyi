# What the harness uses of MuJoCo 4.0.0, whose compiled modules ship without types.

from collections.abc import Callable, Sequence
from enum import IntEnum

import numpy as np
import numpy.typing as npt

_Floats = npt.NDArray[np.float64]

class mjtObj(IntEnum):
    mjOBJ_BODY = ...
    mjOBJ_JOINT = ...
    mjOBJ_GEOM = ...
    mjOBJ_SITE = ...

class mjtDisableBit(IntEnum):
    mjDSBL_CONTACT = ...

class MjOption:
    timestep: float
    disableflags: int

class MjModel:
    nq: int
    nv: int
    njnt: int
    nbody: int
    ngeom: int
    opt: MjOption
    @staticmethod
    def from_xml_string(xml: str) -> MjModel: ...

class MjContact:
    dist: float
    geom: npt.NDArray[np.int32]

class MjData:
    time: float
    ncon: int
    contact: Sequence[MjContact]
    qpos: _Floats
    qvel: _Floats
    qfrc_applied: _Floats
    qfrc_bias: _Floats
    xpos: _Floats
    xmat: _Floats
    site_xpos: _Floats
    site_xmat: _Floats
    def __init__(self, model: MjModel) -> None: ...

def mj_contactForce(m: MjModel, d: MjData, id: int, result: _Floats) -> None: ...  # noqa: A002
def mj_forward(m: MjModel, d: MjData) -> None: ...
def mj_fullM(m: MjModel, d: MjData, dst: _Floats) -> None: ...
def mj_geomDistance(
    m: MjModel, d: MjData, geom1: int, geom2: int, distmax: float, fromto: _Floats | None
) -> float: ...
def mj_id2name(m: MjModel, type: mjtObj, id: int) -> str | None: ...  # noqa: A002
def mj_name2id(m: MjModel, type: mjtObj, name: str) -> int: ...  # noqa: A002
def mj_resetData(m: MjModel, d: MjData) -> None: ...
def mj_step(m: MjModel, d: MjData, nstep: int = 1) -> None: ...
def mj_step1(m: MjModel, d: MjData) -> None: ...
def mj_step2(m: MjModel, d: MjData) -> None: ...
def mj_versionString() -> str: ...
def set_mju_user_warning(callback: Callable[[str], object] | None) -> None: ...
