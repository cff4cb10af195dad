"""Figures draw what they are given and are written whole, twice the same; the page holds them and links its data."""

import itertools
import sys

import numpy as np
import pandas as pd
import pytest
import trimesh
from support.pages import numbers_without_a_file

from softtact.files import write_csv, write_json
from softtact.reporting import render
from softtact.reporting.run_record import run_record
from softtact.reporting.style import draw_map, pyplot, save
from softtact.studies.hybrid.figures import fig4_complexity, fig5_ftir, fig6_ssim, fig7_maps, fig9_networks, fig10_learning_curve
from softtact.studies.hybrid.page import render_page

SSIM = pd.DataFrame([{"model": model, "set": name, "item": item, "trial": trial, "force_n": 10.0, "mae_counts": 9.0,
                      "ssim": 0.5 + 0.1 * trial}
                     for model in ("elastic", "hyperelastic") for name in ("validation", "unseen", "grasps")
                     for item in ("object_1", "object_2") for trial in (0, 1)])
CEILING = SSIM[SSIM.model == "elastic"][["set", "item", "force_n", "ssim"]]
NO_RUN = run_record("nowhere")
COMPLEXITY = pd.DataFrame({"object": ["object_1", "object_2"], "NPt": [100, 900], "CHt": [50, 50], "NPo": [20, 400],
                           "CHo": [20, 20], "model": ["elastic", "hyperelastic"]})


SUMMARY = pd.DataFrame([{"model": "elastic", "set": name, "items": items, "maps": 8, "ssim": 0.6, "ssim_low": low,
                         "ssim_high": high, "mae_counts": 30.0, "overlap": 0.8, "sensor_ssim": 0.99}
                        for name, items, low, high in (("unseen", 4, 0.5, 0.7), ("grasps", 1, np.nan, np.nan))])
BASELINES = pd.concat([SSIM.assign(predictor=name, ssim=score) for name, score in (("zeros", 0.1), ("mean_reading", 0.3),
                                                                                  ("gap_formula", 0.9))])
SCORES = pd.DataFrame([{"model": "elastic", "set": "grasps", "force": force, "predictor": name, "kind": kind, "maps": 4,
                        "ssim": score,
                        "ssim_own_range": score, "mae_counts": 9.0, "mae_share": 0.2, "overlap": 0.8, "skill": skill,
                        "skill_simple": skill} for force in ("all", "10")
                       for name, kind, score, skill in (("printed", "network", 0.2, -0.1), ("mean_reading", "trivial", 0.3, 0.0),
                                                        ("sensor_repeated", "sensor", 0.99, 1.0))])
NETWORKS = pd.concat([SUMMARY.assign(architecture=name, weights=weights, ssim=SUMMARY.ssim + gain,
                                     ssim_high=SUMMARY.ssim_high + gain, epochs=3, epoch_s=time, map_s=0.01)
                      for name, weights, gain, time in (("printed", 94_279_973, 0.0, 90.0), ("compact", 60_345, 0.1, 2.0))])
HISTORY = pd.DataFrame({"epoch": [1, 2, 3], "train_loss": [900, 500, 300], "validation_loss": [1000, 700, 600],
                        "validation_ssim": [0.5, 0.6, 0.7], "learning_rate": 1e-3})


def test_figure_9_shows_each_architectures_scores_and_training():
    histories = {("elastic", name): HISTORY for name in ("printed", "compact")}
    figure = fig9_networks.draw(NETWORKS, histories)
    scores, loss, ssim = figure.axes
    assert [bar.get_height() for bar in scores.patches] == pytest.approx([0.6, 0.6, 0.7, 0.7])
    assert len(loss.lines) == 4
    assert [text.get_text() for text in ssim.get_legend().get_texts()] == ["elastic, printed", "elastic, compact"]
    labels = [text.get_text() for text in scores.get_xticklabels()]
    assert labels == ["unseen\n8 maps, items: 4", "grasps\n8 maps, items: 1\none item:\nno interval"]
    named = [text.get_text() for text in figure.legends[0].get_texts()]
    assert "elastic, printed: 94.3 million weights, 90 s an epoch" in named


def test_a_map_is_printed_with_y_running_to_the_left():
    values = np.zeros((57, 33))
    values[50, 3] = 1.0                                    # large y, small x
    _, axes = pyplot().subplots()
    shown = draw_map(axes, values, extent=(-11, 11, -18.5, 18.5), limits=(0, 1)).get_array()
    assert shown.shape == (33, 57)
    assert shown[3, 56 - 50] == 1.0
    assert axes.get_xlim() == (18.5, -18.5) and axes.get_ylim() == (-11, 11)


def test_figure_6_shows_the_mean_of_every_item_and_model():
    figure = fig6_ssim.draw(SSIM, CEILING, BASELINES, choices={"window": 3, "data_range": 3000.0})
    assert len(figure.axes) == 3
    assert figure.axes[0].get_ylabel() == "SSIM (window 3, range 3000 counts)"
    heights = [bar.get_height() for bar in figure.axes[0].patches]
    assert heights == pytest.approx([0.55] * 4)
    assert "n = 4" in figure.axes[2].get_title()
    marks = {line.get_label(): line.get_ydata() for line in figure.axes[0].lines}
    assert marks["mean training reading at that force"] == pytest.approx([0.3, 0.3])
    assert marks["gap formula, untrained"] == pytest.approx([0.9, 0.9])


@pytest.fixture
def without_renderer(monkeypatch):
    """A renderer that dies as a broken driver does; figures then draw their views themselves, which is quicker, too."""
    monkeypatch.setattr(render, "_COMMAND", (sys.executable, "-S", "-c", "import os; os.abort()"))


def placed(name):
    mesh = trimesh.creation.box((4, 4, 4))
    mesh.apply_translation((0, 0, 2))
    return fig4_complexity.Placed(mesh, (22.0, 37.0), 2.5)


def test_figure_4_draws_the_printed_objects_else_one_for_each_chosen_model_and_all_ratios(without_renderer):
    meshes = {name: placed(name) for name in COMPLEXITY.object}
    indenter = COMPLEXITY.iloc[:1].assign(object="square", NPt=150)     # comes first and has no mesh to draw
    figure = fig4_complexity.draw(pd.concat([indenter, COMPLEXITY]), meshes, thresholds={"total": 10, "overlap": 8})
    assert [axes.get_title() for axes in figure.axes[:-1]] == [
        "object 1: elastic\nmesh NPt 100, hull CHt 50", "over the sensor: NPo 20, CHo 20",
        "object 2: hyperelastic\nmesh NPt 900, hull CHt 50", "over the sensor: NPo 400, CHo 20"]
    points = np.vstack([collection.get_offsets() for collection in figure.axes[-1].collections])
    assert sorted(points[:, 0]) == pytest.approx([2, 3, 18])
    both = COMPLEXITY.assign(object=["object_3", "object_6"])
    assert fig4_complexity.chosen_objects(pd.concat([COMPLEXITY, both]), dict.fromkeys([*both.object, "object_1"])) == [
        "object_3", "object_6"]


def test_a_figure_says_that_matplotlib_drew_its_views(without_renderer, capsys):
    figure = fig4_complexity.draw(COMPLEXITY, {name: placed(name) for name in COMPLEXITY.object},
                                  thresholds={"total": 10, "overlap": 8})
    assert [text.get_text() for text in figure.texts] == [render.FALLBACK]
    assert f"{render.FALLBACK} (status" in capsys.readouterr().err


def test_a_view_is_rendered_without_a_display(monkeypatch):
    monkeypatch.delenv("DISPLAY", raising=False)
    box = trimesh.creation.box((4, 4, 4))
    image, = render.rendered([render.View([render.part_of(box, colour="#ff0000")])], size=(120, 90))
    assert image.shape == (90, 120, 3)
    red = (image[..., 0] > 60) & (image[..., 1] < 60)
    assert 0.1 < red.mean() < 0.9 and (image[0, 0] == 255).all()


def test_a_renderer_that_does_not_answer_is_given_up(monkeypatch, capsys):
    monkeypatch.setattr(render, "_COMMAND", (sys.executable, "-S", "-c", "import time; time.sleep(3600)"))
    assert render.rendered([render.View()], timeout_s=0.3) is None
    assert "no answer within 0.3 s" in capsys.readouterr().err


def test_figure_7_outlines_only_the_chosen_model(without_renderer):
    maps = {"elastic": np.ones((57, 33)), "hyperelastic": np.ones((57, 33))}
    counts = {model: np.ones((7, 4)) for model in maps}
    item = {"name": "object_5", "mesh": trimesh.creation.box((4, 4, 4)), "chosen": "elastic", "force": 50.0, "trials": 5,
            "source": "virtual sensor", "deformation": maps,
            "tactile": counts, "sensor": np.ones((7, 4)), "extent": (-11, 11, -18.5, 18.5)}
    figure = fig7_maps.draw([item], largest_counts=2400)
    red = [axes.get_ylabel().split("\n")[0] for axes in figure.axes
           if "left" in axes.spines and axes.spines["left"].get_edgecolor()[:3] == (1.0, 0.0, 0.0)]
    assert red == ["elastic"]


def test_figure_10_has_a_line_per_model_and_set_with_intervals_and_the_ceiling():
    curves = pd.DataFrame([{"model": model, "architecture": "compact", "set": name, "maps": maps, "ssim": 0.5 + 0.001 * maps,
                            "ssim_low": 0.4, "ssim_high": 0.8} for model in ("elastic", "reference")
                           for name in ("validation", "grasps") for maps in (10, 100)])
    figure = fig10_learning_curve.draw(curves, CEILING, choices={"window": 5, "data_range": 1200.0})
    assert figure.axes[0].get_ylabel() == "SSIM (window 5, range 1200 counts)"
    assert [axes.get_title() for axes in figure.axes] == ["validation", "grasps"]
    for axes in figure.axes:
        assert len(axes.containers) == 2 and len(axes.collections) == 2 and axes.get_xscale() == "log"
        assert axes.containers[0].lines[0].get_ydata() == pytest.approx([0.51, 0.6])
        assert any(line.get_linestyle() == ":" for line in axes.lines)


def test_a_figure_is_written_the_same_twice(tmp_path):
    area = pd.DataFrame({"force_n": [0.0, 10.0], "area_per_frustum_mm2": [0.1, 0.2], "area_measured_mm2": [0.1, 0.2],
                         "area_image_mm2": [0.1, 0.2]})
    summary = {"frusta": 540, "rmse_mm2_per_frustum": 0.001, "source": "virtual dielectric"}
    for name in ("a", "b"):
        save(fig5_ftir.draw(area, summary), tmp_path / f"{name}.png", tmp_path / f"{name}.svg")
    for kind in ("png", "svg"):
        assert (tmp_path / f"a.{kind}").read_bytes() == (tmp_path / f"b.{kind}").read_bytes()


def scored(folder):
    """The scores that a page begins with, written below a folder: a network that is not trained."""
    inputs = {"scores": folder / "tables/scores.csv", "verdicts": folder / "evaluation/verdicts.json"}
    write_csv(inputs["scores"], SCORES)
    write_json(inputs["verdicts"], {"sentences": ["Not trained: the printed network."]})
    return inputs


@pytest.mark.slow
def test_the_page_holds_its_figures_and_links_its_data(tmp_path):
    folder = tmp_path / "results"
    names = ("table1", "contradictions", "table2", "table3", "policies", "networks", "claims", "summary")
    inputs = {name: folder / "tables" / f"{name}.csv" for name in names}
    for name in ("table1", "contradictions", "table2", "table3", "policies", "networks"):
        write_csv(inputs[name], COMPLEXITY)
    write_csv(inputs["summary"], SUMMARY)
    inputs |= scored(folder)
    write_csv(inputs["claims"], pd.DataFrame({"claim": ["a < b"], "verdict": ["reproduced"]}))
    inputs["ftir"] = folder / "summary.json"
    write_json(inputs["ftir"], {"source": "virtual dielectric", "verdict": "The words allow this."})
    inputs["figures"] = [folder / "figures" / f"{name}.png" for name in ("fig6_ssim", "fig5_ftir", "material_foam")]
    for path in inputs["figures"]:
        save(fig6_ssim.draw(SSIM, CEILING), path, path.with_suffix(".svg"))
    source = {"data": [folder / "evaluation/ssim.csv"], "code": ["src/softtact/studies/hybrid/stages/draw.py"]}
    facts = {"study": "mine", "sensor": "pad: 30 x 20 mm", "indenters": 3, "unseen": 1, "grasps": 2, "forces_n": [10.0], "seed": 1,
             "presses": {"indenters": 4, "unseen": 1, "grasps": 2}, "trials": {"indenters": 2, "unseen": 2, "grasps": 50},
             "sources": {"fig6_ssim": source}, "config": {"reference": "felt", "tested": ["hyper"],
                                                    "models": {"felt": {"friction": {"object": 0.3}},
                                                               "hyper": {"mesh": {"preset": "draft"}}}}}
    page = render_page(inputs, facts, folder=folder, run=NO_RUN)
    assert numbers_without_a_file(page) == []
    assert page.count("data:image/png;base64,") == 3
    assert page.count("The words allow this.") == 1 and "Material foam: test curves" in page
    assert 'href="figures/fig6_ssim.svg"' in page and 'href="tables/table2.csv"' in page
    assert 'href="evaluation/ssim.csv"' in page and 'href="sources.html#softtact/studies/hybrid/stages/draw.py"' in page
    assert 'href="sources.html#config"' in page
    assert "pad: 30 x 20 mm. It is not the paper" in page
    for first, then in itertools.pairwise([
            "What was asked", "Not trained: the printed network.", "How sure this is", "No robot and no gripper",
            "the draft one of the hyper model",
            'id="figures"', 'id="result"', 'id="tables"', "Table 3. Time", 'id="claims"', 'id="run"']):
        assert 0 <= page.index(first) < page.index(then), then
    assert "mean training reading at that force" in page and "skill over the best trivial predictor" in page
    assert "mae_counts" not in page
    assert page.count("mesh of the model and root mean square error") == 2     # of the result and the scores by set
    assert "0.500 to 0.700" in page and "one item: none" in page
    assert "3 indenters in 4 places, each read 2 times" in page and "2 objects in 2 places, each read 50 times" in page
    assert "a &lt; b" in page and "What is synthetic" in page
    assert "another mesh, friction, scatter" in page
    facts["config"]["models"]["felt"]["friction"] = None
    assert "another mesh, scatter" in render_page(inputs, facts, folder=folder, run=NO_RUN)
    facts["config"]["data"] = {"source": "recorded"}
    page = render_page(inputs, facts, folder=folder, run=NO_RUN)
    assert "read from recordings of a TSF-85" in page and "none of its numbers is judged" in page
    assert "virtual s" not in page      # neither a virtual sensor nor a virtual specimen


def test_the_page_of_an_archives_study_tells_of_the_archive_and_of_no_virtual_sensor(tmp_path):
    names = ("table1", "contradictions", "table2", "table3", "counts", "networks", "claims", "summary")
    inputs = {name: tmp_path / f"{name}.csv" for name in names}
    for name in ("table1", "contradictions", "table2", "table3", "counts", "networks"):
        write_csv(inputs[name], COMPLEXITY)
    write_csv(inputs["summary"], SUMMARY)
    inputs |= scored(tmp_path)
    write_csv(inputs["claims"], pd.DataFrame({"claim": ["a"], "verdict": ["reproduced"]}))
    inputs |= {"ftir": tmp_path / "ftir.json", "inventory": tmp_path / "inventory.json", "figures": [tmp_path / "fig6_ssim.png"]}
    write_json(inputs["ftir"], {"source": "virtual dielectric", "verdict": ""})
    items = {"indenters": ["a", "b"], "unseen": ["c"], "grasps": ["d"]}
    write_json(inputs["inventory"], {"tests": 9, "tests_used": 8, "tests_left_out": 1, "items": items,
                                     "sentence": "No count is met."})
    save(fig6_ssim.draw(SSIM, CEILING.iloc[:0]), inputs["figures"][0])
    page = render_page(inputs, {"study": "published", "seed": 1, "sources": {}}, folder=tmp_path, run=NO_RUN)
    assert "8 of 9 tests of 2 indenters, 1 held-out ones" in page and "No count is met." in page
    assert "counts against those in print" in page and "Policies that choose" not in page
    assert "virtual sensor" not in page
