"""Settings: what is taken, what is refused and in which words, and what a step's key is made of."""

from __future__ import annotations

import json

import pydantic
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dreamfields_core.config import ConfigError, DreamConfig, HybridConfig, ResidualMLPConfig, override, parts, validate
from dreamfields_core.config.fields import FIELD_KINDS
from dreamfields_core.presets import PRESETS, preset

DEFAULT = DreamConfig()


@pytest.mark.parametrize(
    ("assignment", "path", "value"),
    [
        ("mesh.faces=5000", "mesh.faces", 5000),
        (" mesh.faces = 5000 ", "mesh.faces", 5000),
        ("seed=4294967295", "seed", 2**32 - 1),
        ("render.skip.enabled=false", "render.skip.enabled", False),
        ("optim.rate_end=1e-5", "optim.rate_end", 1e-5),
        ("optim.rate_end=null", "optim.rate_end", None),
        ("guidance.name=embedded", "guidance.name", "embedded"),
        ('guidance.name="a=b"', "guidance.name", "a=b"),
        ("guidance.name=a=b", "guidance.name", "a=b"),
        ('augment.backgrounds=["white","solid"]', "augment.backgrounds", ("white", "solid")),
        ("evaluate.azimuths=[0, 90.5]", "evaluate.azimuths", (0.0, 90.5)),
        ("camera.radius.high=6", "camera.radius.high", 6.0),
        ('camera.radius={"low": 2, "high": 3}', "camera.radius.low", 2.0),
        ("field.width=64", "field.width", 64),
    ],
)
def test_values_are_read_as_json_or_as_text(assignment: str, path: str, value: object) -> None:
    changed = override(DEFAULT, (assignment,))
    for name in path.split("."):
        changed = getattr(changed, name)
    assert changed == value and type(changed) is type(value)


def test_nothing_else_changes() -> None:
    changed = override(DEFAULT, ("mesh.faces=5000", "seed=3"))
    assert changed == DEFAULT.model_copy(update={"seed": 3, "mesh": DEFAULT.mesh.model_copy(update={"faces": 5000})})
    assert override(DEFAULT, ()) == DEFAULT


def test_the_last_of_two_wins() -> None:
    assert override(DEFAULT, ("seed=3", "seed=4")).seed == 4


def test_two_settings_that_only_fit_together() -> None:
    small = override(DEFAULT, ("render.size=20", "render.crop=18"))
    assert (small.render.size, small.render.crop) == (20, 18)


REFUSED = {
    "mesh.faces": "expected part.key=value",
    "=3": "expected part.key=value",
    "mesh.face=3": 'there is no setting "mesh.face"',
    "nothing=3": 'there is no setting "nothing"',
    "nothing.at.all=3": 'there is no setting "nothing.at.all"',
    "mesh.faces.more=3": 'there is no setting "mesh.faces.more"',
    "evaluate.azimuths.0=3": 'there is no setting "evaluate.azimuths.0"',
    "field.resolutions=[4]": 'there is no setting "field.resolutions"',
    "mesh.faces=0": "mesh.faces: input should be greater than or equal to 4, got 0",
    "mesh.faces=many": "mesh.faces: input should be a valid integer",
    "mesh.faces=NaN": "mesh.faces: input should be a finite number, got nan",
    "scene.bound=-1": "scene.bound: input should be greater than or equal to 0.01, got -1",
    "scene.bound=1e39": "scene.bound: input should be less than or equal to 100, got 1e+39; change it with --set scene.bound=VALUE",
    "scene.bound=NaN": "scene.bound: input should be a finite number, got nan",
    "scene.bound=Infinity": "scene.bound: input should be a finite number, got inf",
    "scene.bound=1e400": "scene.bound: input should be a finite number, got inf",
    "seed=-1": "seed: input should be greater than or equal to 0",
    "seed=4294967296": "seed: input should be less than 4294967296",
    "seed=1.5": "seed: input should be a valid integer",
    "render.size=-88": "render.size: input should be greater than or equal to 1",
    "render.size=null": "render.size: input should be a valid integer",
    "render.skip.refresh_turns=5": "expected render.skip.refresh_turns to divide render.skip.resolution, got 5 and 32",
    "render.crop=900": "expected render.crop <= render.size, got crop=900 and size=168",
    "camera.azimuth.low=400": "camera.azimuth: expected low <= high, got low=400.0 and high=360.0",
    "camera.radius.low=0": "camera: expected camera.radius.low > 0, got 0.0",
    "camera.focal.low=-1": "camera: expected camera.focal.low > 0, got -1.0",
    "camera.radius.high=1e9": "camera: expected camera.radius.high <= 1000, got 1000000000.0",
    "camera.elevation.high=91": "camera: expected camera.elevation within -90 and 90, got 30.0 to 91.0",
    "loss.regularizer=l2": "loss.regularizer: input should be 'none', 'density_noise', 'beta_prior', 'gated'",
    "loss.noise_steps=0": "loss.noise_steps: input should be greater than or equal to 1",
    "loss.opacity_start=0": "loss.opacity_start: input should be greater than 0",
    "optim.rate=0": "optim.rate: input should be greater than 0",
    "optim.rate_end=-1": "optim.rate_end: input should be greater than 0",
    "render.skip.explore=0": "render.skip.explore: input should be greater than 0",
    "render.skip.threshold=-1": "render.skip.threshold: input should be greater than or equal to 0",
    "augment.backgrounds=[]": "augment.backgrounds: tuple should have at least 1 item",
    'augment.backgrounds=["pink"]': "augment.backgrounds: input should be 'noise', 'checkerboard', 'fourier', 'solid' or 'white'",
    "guidance.name=": "guidance.name: string should have at least 1 character",
    "field.kind=banana": "field.kind: input tag 'banana'",
    "field=null": "field: ",
    "render=3": "render: ",
}


@pytest.mark.parametrize("assignment", REFUSED)
def test_refused_in_one_sentence(assignment: str) -> None:
    with pytest.raises(ConfigError) as refused:
        override(DEFAULT, (assignment,))
    message = str(refused.value)
    assert REFUSED[assignment] in message
    assert "\n" not in message and len(message) < 300


def test_the_way_out_names_a_setting_that_can_be_set() -> None:
    with pytest.raises(ConfigError, match=r"change it with --set evaluate\.azimuths=VALUE"):
        override(DEFAULT, ('evaluate.azimuths=[1, "x"]',))


def test_a_key_that_nobody_knows_is_refused() -> None:
    with pytest.raises(ConfigError, match=r'there is no setting "mesh\.colour"'):
        validate({"mesh": {"colour": 3}})


@pytest.mark.parametrize("assignments", [("field.kind=hybrid", "field.width=16"), ("field.width=16", "field.kind=hybrid")])
def test_another_kind_of_field_brings_its_own_settings(assignments: tuple) -> None:
    changed = override(DEFAULT, assignments)
    assert changed.field == HybridConfig(width=16)
    back = override(changed, ("field.kind=residual_mlp",))
    assert back.field == ResidualMLPConfig()
    # The same kind again keeps what was set.
    assert override(changed, ("field.kind=hybrid",)).field == HybridConfig(width=16)


def test_a_resolution_named_twice_is_refused_with_the_way_out() -> None:
    with pytest.raises(ConfigError, match=r"field.*expected every resolution once, got \[12, 6, 12\]: take \[6, 12\]"):
        override(DEFAULT, ("field.kind=hybrid", "field.resolutions=[12,6,12]"))


@pytest.mark.parametrize("kind", FIELD_KINDS)
def test_every_kind_of_field_can_be_named_and_survives_json(kind: str) -> None:
    changed = override(DEFAULT, (f"field.kind={kind}",))
    assert changed.field.kind == kind and validate(json.loads(json.dumps(changed.model_dump(mode="json")))) == changed


def test_frequencies_along_the_axes_come_in_whole_octaves() -> None:
    assert override(DEFAULT, ("field.fourier=false", "field.levels=6")).field == ResidualMLPConfig(fourier=False, levels=6.0)
    with pytest.raises(ConfigError, match=r"expected a whole number of levels along the axes, got 6\.5: set field.fourier=true"):
        override(DEFAULT, ("field.kind=nerf_mlp", "field.levels=6.5"))


def test_a_setting_of_the_old_kind_is_refused() -> None:
    with pytest.raises(ConfigError, match=r'there is no setting "field\.bottleneck"'):
        override(DEFAULT, ("field.kind=hybrid", "field.bottleneck=16"))


def test_frozen() -> None:
    with pytest.raises(pydantic.ValidationError):
        DEFAULT.mesh.faces = 3  # type: ignore[misc]
    with pytest.raises(pydantic.ValidationError):
        DEFAULT.seed = 3  # type: ignore[misc]
    assert hash(DEFAULT.render) == hash(DreamConfig().render)


def test_parts_are_what_was_named_and_json() -> None:
    named = parts(DEFAULT, ("mesh", "guidance.name", "render.skip.chunk"))
    assert list(named) == ["mesh", "guidance.name", "render.skip.chunk"]
    assert named["mesh"] == DEFAULT.mesh.model_dump(mode="json")
    assert (named["mesh"]["resolution"], named["mesh"]["faces"]) == (128, 20_000)
    assert named["guidance.name"] == "embedded" and named["render.skip.chunk"] is None
    assert json.loads(json.dumps(named)) == named
    changed = override(DEFAULT, ("mesh.faces=5000",))
    assert parts(changed, ("field", "render")) == parts(DEFAULT, ("field", "render"))
    assert parts(changed, ("mesh",)) != parts(DEFAULT, ("mesh",))
    with pytest.raises(KeyError):
        parts(DEFAULT, ("nothing",))


@pytest.mark.parametrize("name", PRESETS)
def test_presets_are_valid_and_survive_json(name: str) -> None:
    config = preset(name)
    assert validate(json.loads(json.dumps(config.model_dump(mode="json")))) == config
    assert config.render.crop <= config.render.size


PAPER = [("low", 88, 80, 10_000), ("medium", 168, 154, 10_000), ("high", 252, 224, 20_000)]


@pytest.mark.parametrize(("name", "size", "crop", "steps"), PAPER)
def test_the_papers_presets(name: str, size: int, crop: int, steps: int) -> None:
    config = preset(name)
    assert (config.render.size, config.render.crop, config.optim.steps, config.render.samples) == (size, crop, steps, 192)
    assert config.field == ResidualMLPConfig() and config.camera == DEFAULT.camera and config.loss == DEFAULT.loss
    assert (config.optim.rate_start, config.optim.rate, config.optim.warmup_steps, config.optim.epsilon) == (1e-5, 1e-4, 1500, 1e-5)


def test_an_unknown_preset_is_refused_with_those_there_are() -> None:
    with pytest.raises(ConfigError, match='expected a preset among draft, low, medium, high, got "huge"'):
        preset("huge")


TEXTS = st.text(alphabet=st.characters(codec="utf-8"), max_size=12)
KEYS = st.sampled_from(
    ["mesh.faces", "scene.bound", "field.kind", "field", "camera.radius", "augment.backgrounds", "seed", "optim.rate_end", "x"]
)


@settings(max_examples=150)
@given(key=KEYS, text=st.one_of(TEXTS, st.sampled_from(["[]", "{}", "null", "true", "-0", "1e999", '{"kind":[]}', "[[[", '"'])))
def test_whatever_is_written_gives_a_config_or_one_sentence(key: str, text: str) -> None:
    try:
        assert isinstance(override(DEFAULT, (f"{key}={text}",)), DreamConfig)
    except ConfigError as refused:
        assert len(str(refused)) < 400
