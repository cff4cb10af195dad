"""The YAML file of a material: typed, described in place, and turned into the settings of its two stages.

material: neoprene
curves:   where the test curves come from: `kind: synthetic` (made from a law) or `kind: measured` (the user's files)
fit:      how the laws are fitted
printed:  constants published for it, {law: {parameters: ..., rmse_mpa: ...}}
"""

from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

import pydantic
from pydantic import Field

from softtact.errors import InputError
from softtact.files import read_yaml
from softtact.materials.curves import refuse_idle
from softtact.materials.laws.base import SIMPLE_SHEAR, Law
from softtact.materials.laws.registry import law_class, make_law
from softtact.materials.linear import LinearConstants
from softtact.unknown_names import Section, first_fault, known_keys, unknown

Mode = Literal["uniaxial", "equibiaxial", "planar", "simple_shear", "volumetric"]
_Model = TypeVar("_Model", bound=pydantic.BaseModel)


def _rising(window):
    if not window[0] < window[1]:
        raise ValueError("a window is [from, to] with from < to")
    return window


def _positive(windows):
    if mode := next((mode for mode, (low, _) in windows.items() if low <= 0 and mode != SIMPLE_SHEAR), None):
        raise ValueError(f"a window of {mode} is of stretches or volume ratios, above 0")
    return windows


def _some(laws):
    if not laws:
        raise ValueError("name one law at least, or all of them")
    return laws


Window = Annotated[tuple[float, float], pydantic.AfterValidator(_rising)]
Windows = Annotated[dict[Mode, Window], pydantic.AfterValidator(_positive)]


class SyntheticCurves(Section):
    """Curves made from a law, with noise; for a study without test data."""

    kind: Literal["synthetic"]
    law: str = Field(description="law that the curves follow")
    parameters: dict[str, float] | None = Field(None, description="its constants; those under `printed` by default")
    noise: float = Field(ge=0, le=0.5, description="standard deviation as a share of a curve's largest stress")
    points: int = Field(ge=3, description="points per curve")
    seed: int = Field(ge=0)
    modes: Windows = Field(min_length=1, description="stretch (shear strain, volume ratio) from, to in each test mode")
    bulk_over_shear: float = Field(20.0, gt=2 / 3, description="K / mu0 behind a volumetric curve")


class MeasuredFile(Section):
    """One file of a user's test; see `softtact.materials.readers`."""

    file: str = Field(description="path, relative to the YAML file")
    mode: Mode
    layout: Literal["plain", "soro_db", "stress_stretch"] = "plain"
    columns: dict[str, str] = Field(default_factory=dict, description="declared name -> header in the file")
    sort: bool = Field(False, description="order the rows by stretch")
    compression: bool = Field(False, description="a compression test written without a minus")
    decimal: Literal[".", ","] = Field(".", description="the decimal sign")
    skip_rows: int = Field(0, ge=0, description="lines above the header that are passed over")
    sheet: str | None = Field(None, description="of an Excel workbook that has several")
    area_mm2: float | None = Field(None, gt=0, description="undeformed section, for a column of force")
    length_mm: float | None = Field(None, gt=0, description="undeformed length, for a column of extension")
    holds: Literal["instantaneous", "relaxed"] | None = Field(None, description="stress to take where steps relax")


class MeasuredCurves(Section):
    """Curves from a user's files."""

    kind: Literal["measured"]
    files: list[MeasuredFile] = Field(min_length=1)


class FitSettings(Section):
    """How the laws are fitted; see `softtact.materials.card_making.CardOptions`."""

    laws: Annotated[Literal["all"] | list[str], pydantic.AfterValidator(_some)] = "all"
    choose: str = Field("best", description="law for the solvers, or best")
    bulk_over_shear: float = Field(20.0, gt=2 / 3, description="K / mu0 without a volumetric curve; 2/3 is Poisson's ratio 0")
    poisson: float | None = Field(None, gt=-1, lt=0.5, description="of the linear constants; curves do not hold it")
    small_strain: float = Field(0.1, gt=0, lt=1, description="strain up to which E is the slope")
    window: Windows = Field(default_factory=dict, description="stretch to use, all by default")
    residual: Literal["absolute", "relative"] = Field("absolute", description="errors in MPa, or over the stress")
    weights: dict[Mode, Annotated[pydantic.FiniteFloat, Field(gt=0)]] = Field(
        default_factory=dict, description="of squared residuals, else 1")
    nonnegative: bool = Field(False, description="keep constants in MPa from being negative")
    predict_left_out: bool = Field(True, description="fit also without each mode in turn, and predict it")
    disagreement: float = Field(0.2, gt=0, description="difference of two laws' stresses, as a share, that is named")
    starts: int = Field(24, ge=1)
    seed: int = Field(0, ge=0)


class PrintedLaw(Section):
    """Constants as a publication prints them."""

    parameters: dict[str, float]
    rmse_mpa: float | None = None


class FitStage(FitSettings):
    """Settings of the stage fit_material."""

    material: str
    printed: dict[str, PrintedLaw] = Field(default_factory=dict)


class MaterialConfig(Section):
    """One material."""

    material: str = Field(pattern=r"^[a-z0-9_]+$")
    description: str = ""
    curves: Annotated[SyntheticCurves | MeasuredCurves, Field(discriminator="kind")]
    fit: FitSettings = FitSettings()
    source: str = Field("", description="where the constants are printed")
    printed: dict[str, PrintedLaw] = Field(default_factory=dict)

    @property
    def modes(self) -> list[str]:
        """Test modes of the curves: one curve file each."""
        if self.curves.kind == "synthetic":
            return list(self.curves.modes)
        return list(dict.fromkeys(file.mode for file in self.curves.files))

    @property
    def measured_files(self) -> list[str]:
        """Paths of the user's files, in order; none for synthetic curves."""
        return [] if self.curves.kind == "synthetic" else [file.file for file in self.curves.files]

    @property
    def curve_settings(self) -> dict[str, Any]:
        """Settings of the stage make_curves."""
        settings = {"material": self.material} | self.curves.model_dump(mode="json", exclude_none=True)
        window = self.fit.window if self.curves.kind == "measured" else {}
        return settings | ({"window": {mode: list(ends) for mode, ends in window.items()}} if window else {})

    @property
    def fit_settings(self) -> dict[str, Any]:
        """Settings of the stage fit_material."""
        stage = FitStage(material=self.material, printed=self.printed, **self.fit.model_dump())
        return stage.model_dump(mode="json", exclude_none=True)


def load_material(path: str | Path) -> MaterialConfig:
    """Read a material's YAML into a `MaterialConfig`; a fault raises an InputError of one sentence."""
    path = Path(path)
    known = ", ".join(sorted(file.stem for file in path.parent.glob("*.yaml"))) or "none"
    raw = read_yaml(path, missing=f"there is no such material; known beside it: {known}.")
    config = validated(MaterialConfig, raw, where=str(path))
    try:
        return _resolved(config, path)
    except InputError as error:     # of laws and constants: the message does not name the file
        raise InputError(f"{path}: {error}") from None


def validated(model: type[_Model], raw: Any, *, where: str) -> _Model:
    """`model` from plain values; the first fault becomes an `InputError` that names the field and its value."""
    try:
        return model.model_validate(raw)
    except pydantic.ValidationError as error:
        fault = first_fault(error)
        field = ".".join(str(part) for part in fault["loc"] if part not in ("synthetic", "measured")) or "the file"
        raise InputError(f"{where}: {_fault(model, field, fault)}") from None


def _fault(model, field, fault):
    """The fault of a field, and its remedy."""
    if fault["type"] == "extra_forbidden":
        *parents, last = fault["loc"]
        fault = unknown(last, known_keys(model, parents), kind="key")
        return f"the key {field} is unknown: {fault}{'' if fault.endswith('?') else '.'}"
    if fault["type"] == "missing":
        return f"the key {field} is missing; add it."
    reason = fault["msg"].removeprefix("Value error, ")
    if fault["type"] == "value_error" and isinstance(fault["input"], dict):     # a section whose keys do not fit together
        return f"{field}: {reason}."
    return f"{field} is {fault['input']!r:.80}; {reason[0].lower()}{reason[1:]}."


def law_from_printed(material_yaml: str | Path, law: str, *, bulk_over_shear: float | None = None) -> Law:
    """The `Law` with the constants that a material's YAML prints for it; bulk_over_shear: K / mu0, by default that of the file."""
    config = load_material(material_yaml)
    return make_law(law, _printed_parameters(config, law), bulk_over_shear=bulk_over_shear or config.fit.bulk_over_shear)


def _printed_parameters(config, law):
    laws = [name for name in config.printed if name != "linear"]
    if law not in laws:
        raise InputError(
            f"Material {config.material} has no printed constants of law {law!r}; it has {', '.join(laws) or 'none'}."
        )
    return config.printed[law].parameters


def _resolved(config, path):
    """The config with its curves' constants filled in, and file paths relative to the working folder."""
    _check_laws(config)
    refuse_idle(config.fit.window, config.fit.weights, modes=config.modes)
    curves = config.curves
    if curves.kind == "measured":
        files = [file.model_copy(update={"file": str(path.parent / file.file)}) for file in curves.files]
        return config.model_copy(update={"curves": curves.model_copy(update={"files": files})})
    parameters = curves.parameters or _printed_parameters(config, curves.law)
    make_law(curves.law, parameters)
    return config.model_copy(update={"curves": curves.model_copy(update={"parameters": parameters})})


def _check_laws(config):
    """Refuse unknown laws and constants before a study begins."""
    for name in config.fit.laws if config.fit.laws != "all" else []:
        law_class(name, fitted=True)
    if config.fit.choose != "best":
        law_class(config.fit.choose, fitted=True)
    for name, entry in config.printed.items():
        LinearConstants.of(entry.parameters) if name == "linear" else make_law(name, entry.parameters)
