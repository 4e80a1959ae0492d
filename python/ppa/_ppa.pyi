"""Types of the compiled module, whose docstrings describe shapes and units."""

import os
from collections.abc import Callable, Sequence
from typing import Any, Literal, TypeAlias, final

import numpy as np
import numpy.typing as npt

_Path: TypeAlias = str | os.PathLike[str]
_Side: TypeAlias = Literal["l", "r", "left", "right"]
_Settings: TypeAlias = dict[str, Any]
_Progress: TypeAlias = bool | Callable[[float, float], object] | None
_Technique: TypeAlias = Literal["ankle", "knee", "lower-leg", "foot", "hand", "wrist", "elbow"]
_Scale: TypeAlias = Literal["graded", "strict"]
_Source: TypeAlias = _Path | dict[str, Any]
_Engine: TypeAlias = Literal["fast", "analog"]
_F32: TypeAlias = npt.NDArray[np.float32]
_F64: TypeAlias = npt.NDArray[np.float64]

__version__: str

class PpaError(ValueError): ...
class InternalError(RuntimeError): ...

@final
class Volume:
    def __new__(
        cls, voxels: npt.NDArray[np.int16] | npt.NDArray[np.float32], affine: npt.ArrayLike
    ) -> Volume: ...
    @staticmethod
    def read(
        path: _Path,
        *,
        series: int | str | None = None,
        fill_gaps: bool = False,
        force: bool = False,
        threads: int | None = None,
    ) -> Volume: ...
    @staticmethod
    def from_image(image: Any) -> Volume: ...
    def to_simpleitk(self) -> Any: ...
    def to_nibabel(self) -> Any: ...
    def save(self, path: _Path, *, threads: int | None = None) -> None: ...
    @property
    def voxels(self) -> npt.NDArray[np.int16] | npt.NDArray[np.float32]: ...
    @property
    def affine(self) -> _F64: ...
    @property
    def shape(self) -> tuple[int, int, int]: ...
    @property
    def spacing_mm(self) -> _F64: ...
    @property
    def path(self) -> str | None: ...
    @property
    def warnings(self) -> list[dict[str, str]]: ...
    @property
    def sha256(self) -> str: ...
    def crop(self, low: Sequence[int], high: Sequence[int]) -> Volume: ...

@final
class Case:
    @staticmethod
    def read(path: _Path, *, threads: int | None = None) -> Case: ...
    def save(self, path: _Path) -> None: ...
    def save_skin(self, path: _Path) -> None: ...
    @property
    def side(self) -> Literal["l", "r"]: ...
    @property
    def volume(self) -> Volume: ...
    @property
    def vertices(self) -> _F32: ...
    @property
    def normals(self) -> _F32: ...
    @property
    def triangles(self) -> npt.NDArray[np.uint32]: ...
    @property
    def joint(self) -> _F64: ...
    @joint.setter
    def joint(self, value: npt.ArrayLike) -> None: ...
    @property
    def axis(self) -> _F64: ...
    @axis.setter
    def axis(self, value: npt.ArrayLike) -> None: ...
    @property
    def anterior(self) -> _F64: ...
    @anterior.setter
    def anterior(self, value: npt.ArrayLike) -> None: ...
    @property
    def plane(self) -> _F64: ...
    @plane.setter
    def plane(self, value: npt.ArrayLike) -> None: ...
    @property
    def landmarks(self) -> dict[str, Any]: ...
    @property
    def findings(self) -> list[dict[str, Any]]: ...
    @property
    def bones(self) -> dict[str, Any] | None: ...
    @property
    def patient_from_ct(self) -> _F64: ...
    def place(
        self, angle: float = 0.0, *, scene: Scene | None = None, threads: int | None = None
    ) -> Pose: ...
    def plot(self, ax: Any = None) -> Any: ...

@final
class Plan:
    def __new__(
        cls,
        cases: Sequence[tuple[_Path, int]] = ...,
        *,
        seed: int = 0,
        technique: _Technique | None = None,
        rotation: _Settings | None = None,
        shapes: _Settings | None = None,
        soft_tissue: _Settings | None = None,
        positioning: _Settings | None = None,
        room: _Settings | None = None,
        depth: _Settings | None = None,
        xray: _Settings | None = None,
    ) -> Plan: ...
    @classmethod
    def read(cls, path: _Path) -> Plan: ...
    def save(self, path: _Path) -> None: ...
    @property
    def settings(self) -> dict[str, Any]: ...

@final
class Scene:
    def __new__(cls, plan: Plan | _Path | None = None, *, room: _Path | None = None) -> Scene: ...
    @property
    def plan(self) -> Plan: ...
    @property
    def frames(self) -> dict[str, _F64]: ...
    @property
    def table(self) -> _F64: ...
    @property
    def source_detector_mm(self) -> float: ...
    def plot(self, ax: Any = None) -> Any: ...

@final
class Camera:
    def __new__(cls, room_from_camera: npt.ArrayLike, lens: _Settings | _Path | None = None) -> Camera: ...
    @property
    def lens(self) -> dict[str, Any]: ...

@final
class Pose:
    @property
    def angle_deg(self) -> float: ...
    @property
    def room_from_patient(self) -> _F64: ...
    @property
    def room_from_ct(self) -> _F64: ...
    @property
    def frames(self) -> dict[str, _F64]: ...
    @property
    def source_detector_mm(self) -> float: ...
    @property
    def contact(self) -> dict[str, float]: ...
    @property
    def vertices(self) -> _F32: ...
    @property
    def triangles(self) -> npt.NDArray[np.uint32]: ...
    def depth(
        self,
        camera: Literal["left", "right"] | Camera | None = None,
        *,
        sensor: Literal["default"] | _Settings | None = None,
        seed: int = 0,
        threads: int | None = None,
    ) -> DepthImage: ...
    def radiograph(
        self,
        *,
        tube: _Settings | None = None,
        technique: _Technique | None = None,
        xray: _Settings | None = None,
        engine: _Engine = "fast",
        histories: float | None = None,
        mas: float | None = None,
        exposure_index: float | None = None,
        target_error: float | None = None,
        seconds: float | None = None,
        dose: bool | Literal["map"] | None = None,
        seed: int = 0,
        progress: _Progress = None,
        threads: int | None = None,
    ) -> Radiograph: ...
    def label(
        self,
        *,
        scale: _Scale = "graded",
        thresholds: _Settings | _Path | None = None,
        threads: int | None = None,
    ) -> dict[str, Any]: ...
    def plot(self, ax: Any = None) -> Any: ...

@final
class DepthImage:
    @property
    def z_mm(self) -> _F32: ...
    @property
    def lens(self) -> dict[str, Any]: ...
    @property
    def roi(self) -> tuple[int, int, int] | None: ...
    def to_uint16(self) -> npt.NDArray[np.uint16]: ...
    def points(self) -> _F64: ...
    def save(self, path: _Path) -> None: ...
    def save_preview(self, path: _Path) -> None: ...
    def plot(self, ax: Any = None) -> Any: ...
    def __array__(self, dtype: Any = None, copy: bool | None = None) -> npt.NDArray[Any]: ...
    def __dlpack__(self, **options: Any) -> Any: ...
    def __dlpack_device__(self) -> tuple[int, int]: ...

@final
class Radiograph:
    @property
    def layers(self) -> dict[str, _F32]: ...
    @property
    def standard_errors(self) -> dict[str, _F32]: ...
    @property
    def total(self) -> _F32: ...
    @property
    def total_error(self) -> _F32: ...
    @property
    def open_field(self) -> _F64: ...
    @property
    def sums(self) -> dict[str, float]: ...
    @property
    def histories(self) -> float: ...
    @property
    def histories_per_mas(self) -> float | None: ...
    @property
    def mas(self) -> float | None: ...
    @property
    def exposure_index(self) -> float | None: ...
    @property
    def engine(self) -> _Engine: ...
    @property
    def pixel_mm(self) -> float: ...
    @property
    def dose(self) -> dict[str, Any] | None: ...
    def dose_map(self) -> Volume: ...
    def picture(
        self, protocol: str | _Settings | None = None, *, fitted: bool = False
    ) -> npt.NDArray[np.uint16]: ...
    def save(
        self, path: _Path, protocol: str | _Settings | None = None, *, fitted: bool = False
    ) -> None: ...
    def plot(self, ax: Any = None) -> Any: ...
    def __array__(self, dtype: Any = None, copy: bool | None = None) -> npt.NDArray[Any]: ...
    def __dlpack__(self, **options: Any) -> Any: ...
    def __dlpack_device__(self) -> tuple[int, int]: ...

@final
class Spectrum:
    def __new__(
        cls, kvp: float = 60.0, filters: Sequence[str] = ..., anode_angle_deg: float = 12.0
    ) -> Spectrum: ...
    @staticmethod
    def monoenergetic(energy_kev: float) -> Spectrum: ...
    @staticmethod
    def from_bins(edges_kev: npt.ArrayLike, weights: npt.ArrayLike) -> Spectrum: ...
    @property
    def edges_kev(self) -> _F64: ...
    @property
    def weights(self) -> _F64: ...
    @property
    def mean_energy_kev(self) -> float: ...
    @property
    def hvl1_mm_al(self) -> float: ...
    @property
    def hvl2_mm_al(self) -> float: ...
    @property
    def fluence_per_mas_cm2_at_1m(self) -> float | None: ...
    @property
    def kerma_ugy_per_mas_at_1m(self) -> float | None: ...

@final
class Material:
    def __new__(cls, name: str) -> Material: ...
    @staticmethod
    def compound(name: str, density_g_cm3: float, composition: str) -> Material: ...
    @staticmethod
    def names() -> list[str]: ...
    @property
    def name(self) -> str: ...
    @property
    def density_g_cm3(self) -> float: ...
    @property
    def composition(self) -> str: ...
    def photoelectric_cm2_g(self, energy_kev: npt.ArrayLike) -> _F64: ...
    def rayleigh_cm2_g(self, energy_kev: npt.ArrayLike) -> _F64: ...
    def compton_cm2_g(self, energy_kev: npt.ArrayLike) -> _F64: ...
    def total_cm2_g(self, energy_kev: npt.ArrayLike) -> _F64: ...

@final
class Transport:
    def __new__(
        cls,
        material: npt.NDArray[np.uint8],
        density_g_cm3: _F32,
        materials: Sequence[Material | str],
        affine: npt.ArrayLike,
        *,
        interpolation: Literal["nearest", "trilinear"] = "nearest",
    ) -> Transport: ...
    @staticmethod
    def of_volume(
        volume: Volume,
        *,
        calibration: _Settings | None = None,
        mask: npt.NDArray[np.bool_] | None = None,
        threads: int | None = None,
    ) -> Transport: ...
    @property
    def materials(self) -> list[str]: ...
    @property
    def affine(self) -> _F64: ...
    def radiograph(
        self,
        ct_from_device: npt.ArrayLike,
        source_detector_mm: float,
        *,
        spectrum: Spectrum | None = None,
        technique: _Technique | None = None,
        xray: _Settings | None = None,
        engine: _Engine = "fast",
        histories: float | None = None,
        mas: float | None = None,
        exposure_index: float | None = None,
        target_error: float | None = None,
        seconds: float | None = None,
        dose: bool | Literal["map"] | None = None,
        seed: int = 0,
        progress: _Progress = None,
        threads: int | None = None,
    ) -> Radiograph: ...

@final
class Dataset:
    def __new__(
        cls,
        path: _Path,
        *,
        views: Literal["pairs", "left", "right", "unified"] = "pairs",
        side: int = 224,
        patients: Sequence[int] | None = None,
        shapes: Sequence[str] | None = None,
        every_pose: int | None = None,
        labels: str | None = None,
        unlabelled: bool = False,
        mirror: bool = False,
        transform: Callable[[_F32], Any] | None = None,
    ) -> Dataset: ...
    def __len__(self) -> int: ...
    def __getitem__(self, index: int, /) -> tuple[Any, float]: ...
    def drawn(
        self,
        place: int,
        *,
        seed: int = 1,
        balanced: bool = True,
        augmentation: _Settings | None = None,
    ) -> tuple[Any, float]: ...
    @property
    def labels(self) -> _F64: ...
    @property
    def rows(self) -> list[dict[str, Any]]: ...

@final
class Network:
    @staticmethod
    def load(
        left: _Path,
        right: _Path | None = None,
        *,
        side: _Side | None = None,
        confidence: _Path | None = None,
        device: str = "cpu",
    ) -> Network: ...
    def predict(
        self,
        depth_left: DepthImage | npt.NDArray[np.uint16],
        depth_right: DepthImage | npt.NDArray[np.uint16],
        *,
        roi_left: Sequence[int] | None = None,
        roi_right: Sequence[int] | None = None,
        threads: int | None = None,
    ) -> dict[str, Any]: ...

def phantom(
    name: str = "P01",
    side: _Side = "r",
    *,
    seed: int | None = None,
    plate: bool = False,
    spacing_mm: float = 0.8,
    table: bool = False,
    blur_mm: float = 0.0,
    noise_hu: float = 0.0,
    noise_seed: int = 0,
    threads: int | None = None,
) -> Volume: ...
def phantom_bones(
    volume: Volume, name: str = "P01", side: _Side = "r", *, seed: int | None = None, threads: int | None = None
) -> Volume: ...
def phantom_truth(name: str = "P01", side: _Side = "r", *, seed: int | None = None) -> dict[str, Any]: ...
def prepare(
    volume: Volume | _Path,
    side: _Side,
    *,
    limb: Literal["lower_leg", "knee", "other"] | None = None,
    iso_hu: float = ...,
    crop: Sequence[Sequence[int]] | None = None,
    inside: npt.ArrayLike | None = None,
    keep: npt.ArrayLike | None = None,
    remove: npt.ArrayLike | None = None,
    joint: npt.ArrayLike | None = None,
    axis_source: Literal["bone", "limb"] | None = None,
    joint_region: npt.ArrayLike | None = None,
    calf_region: npt.ArrayLike | None = None,
    axis: npt.ArrayLike | None = None,
    anterior: npt.ArrayLike | None = None,
    plane: npt.ArrayLike | None = None,
    bones: _Path | None = None,
    bone_numbers: Sequence[int] = ...,
    segment_bones: _Path | None = None,
    replace: bool = False,
    threads: int | None = None,
) -> Case: ...
def generate(
    plan: Plan | _Path,
    out: _Path,
    *,
    seed: int | None = None,
    shard: str | None = None,
    replace: bool = False,
    disk_limit: int | None = None,
    progress: _Progress = None,
    threads: int | None = None,
) -> dict[str, Any]: ...
def label(
    dataset: _Path,
    plan: Plan | _Path | None = None,
    *,
    scale: _Scale = "graded",
    name: str | None = None,
    thresholds: _Settings | _Path | None = None,
    replace: bool = False,
    progress: _Progress = None,
    threads: int | None = None,
) -> dict[str, Any]: ...
def train(
    training: _Source | list[_Source],
    out: _Path,
    *,
    evaluation: _Source | list[_Source] | None = None,
    preset: Literal["quick", "standard", "paper"] = "standard",
    seed: int | None = None,
    progress: _Progress = None,
    threads: int | None = None,
    **settings: Any,
) -> dict[str, Any]: ...
def training_log(run: _Path) -> list[dict[str, Any]]: ...
def evaluate(labels: npt.ArrayLike, predictions: npt.ArrayLike) -> dict[str, Any]: ...
def permutation_test(
    a: npt.ArrayLike,
    b: npt.ArrayLike,
    *,
    seeds: npt.ArrayLike | None = None,
    threads: int | None = None,
) -> dict[str, Any]: ...
def run_program(arguments: Sequence[str], program: _Path) -> int: ...
