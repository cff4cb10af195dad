# Tables, one rule per figure, and the page that gathers them.

GRASPS = [item for item in STUDY.items_of["grasps"].values() if item.first]  # each object once
SHOWN = GRASPS[:6]  # in figure 7, as in print
FROM_PRESSES = () if STUDY.archive else ("fig2_section", "fig7_maps", "fig8_policies")  # an archive has no press of our objects
VIEWS = () if STUDY.archive else ("pressed_sensor",)  # HTML: they turn
FROM_CURVES = ("fig10_learning_curve",) if CURVES else ()
FIGURES = sorted(
    ["fig4_complexity", "fig5_ftir", "fig6_ssim", *FROM_PRESSES, "fig9_networks", *FROM_CURVES],
    key=lambda name: int(name[3:].split("_")[0]),
)


def figure_files(name):
    """A figure's two files."""
    return {kind: f"{RESULTS}/figures/{name}.{kind}" for kind in ("png", "svg")}


if not STUDY.archive:

    rule measure_features:
        input:
            objects=[item.file for item in GRASPS],
            presses=[f"{RESULTS}/presses/grasps/{item.id}/{model}.nc" for item in GRASPS for model in STUDY.learnt_from],
        output:
            features=f"{RESULTS}/evaluation/features.csv",
        log:
            log_of("measure_features"),
        benchmark:
            benchmark_of("measure_features")
        params:
            code=code("measure_features"),
            files=files,
            settings=as_settings(
                objects=[{"name": item.id, "unit": item.unit, "pose": item.pose} for item in GRASPS],
                frustum_height_mm=STUDY.spec.dielectric.frusta.height_mm,
            ),
        shell:
            run_stage("measure_features")


rule make_tables:
    input:
        **(
            {}
            if STUDY.archive
            else {
                "features": rules.measure_features.output.features,
                "pressed": [f"{RESULTS}/presses/grasps/{FIRST.id}/{model}.nc" for model in STUDY.tested],
                "repeated": [f"{RESULTS}/repeated/{model}.nc" for model in STUDY.tested],
            }
        ),
        cards=[f"{RESULTS}/materials/{name}.json" for name in STUDY.values.materials],
        complexity=rules.score_complexity.output.table,
        ftir=rules.validate_ftir.output.summary,
        ssim=rules.evaluate.output.ssim,
        summary=rules.evaluate.output.summary,
        per_item=rules.evaluate.output.per_item,
        ceiling=rules.evaluate.output.ceiling,
        timing=rules.evaluate.output.timing,
        scores=rules.compare_networks.output.scores,
        taxels=rules.score_baselines.output.taxels,
        searches=[f"{RESULTS}/learning/{model}/best.json" for model in STUDY.tested],
    output:
        table1=shown(f"{RESULTS}/tables/table1_materials.csv"),
        contradictions=shown(f"{RESULTS}/tables/table1_contradictions.csv"),
        table2=shown(f"{RESULTS}/tables/table2_complexity.csv"),
        table3=shown(f"{RESULTS}/tables/table3_timing.csv"),
        claims=shown(f"{RESULTS}/tables/claims.csv"),
    log:
        log_of("make_tables"),
    benchmark:
        benchmark_of("make_tables")
    params:
        code=code("make_tables"),
        files=files,
        settings=as_settings(
            **plain(STUDY.values.complexity),
            source=STUDY.source,
            models=STUDY.tested,
            reference=STUDY.values.reference,
            sensor=STUDY.spec.name,
        ),
    shell:
        run_stage("make_tables")


if not STUDY.archive:

    rule draw_fig2_section:
        input:
            body=rules.press_section.output.body,
            summary=rules.press_section.output.summary,
            object=STUDY.section_item.file,
        output:
            **all_shown(figure_files("fig2_section")),
        log:
            log_of("draw_fig2_section"),
        benchmark:
            benchmark_of("draw_fig2_section")
        params:
            code=code("draw_fig2_section"),
            files=files,
            settings=as_settings(sensor=STUDY.sensor, unit=STUDY.section_item.unit, pose=STUDY.section_item.pose),
        shell:
            run_stage("draw_fig2_section")

    rule draw_pressed_sensor:
        input:
            body=rules.press_section.output.body,
            summary=rules.press_section.output.summary,
            object=STUDY.section_item.file,
        output:
            html=shown(f"{RESULTS}/figures/pressed_sensor.html"),
        log:
            log_of("draw_pressed_sensor"),
        benchmark:
            benchmark_of("draw_pressed_sensor")
        params:
            code=code("draw_pressed_sensor"),
            files=files,
            settings=as_settings(unit=STUDY.section_item.unit, pose=STUDY.section_item.pose),
        shell:
            run_stage("draw_pressed_sensor")


rule draw_fig4_complexity:
    input:
        complexity=rules.score_complexity.output.table,
        objects=[item.file for item in GRASPS],
    output:
        **all_shown(figure_files("fig4_complexity")),
    log:
        log_of("draw_fig4_complexity"),
    benchmark:
        benchmark_of("draw_fig4_complexity")
    params:
        code=code("draw_fig4_complexity"),
        files=files,
        settings=as_settings(
            thresholds=plain(STUDY.values.complexity)["thresholds"],
            objects=[{"name": item.id, "unit": item.unit, "pose": item.pose} for item in GRASPS],
            footprint_mm=STUDY.spec.footprint_mm,
            reach_mm=STUDY.spec.thickness_mm,
        ),
    shell:
        run_stage("draw_fig4_complexity")


rule compare_policies:
    input:
        **{kind: presses([model]) for kind, model in STUDY.values.choice.models.items()},
        complexity=rules.score_complexity.output.table,
    output:
        presses=f"{RESULTS}/choice/presses.csv",
        policies=shown(f"{RESULTS}/tables/policies.csv"),
        calibration=f"{RESULTS}/choice/calibration.json",
    log:
        log_of("compare_policies"),
    benchmark:
        benchmark_of("compare_policies")
    params:
        code=code("compare_policies"),
        files=files,
        settings=as_settings(sensor=STUDY.sensor, tolerances_mm=STUDY.values.choice.tolerances_mm),
    shell:
        run_stage("compare_policies")


rule draw_fig5_ftir:
    input:
        area=rules.validate_ftir.output.area,
        orientations=rules.validate_ftir.output.orientations,
        summary=rules.validate_ftir.output.summary,
    output:
        **all_shown(figure_files("fig5_ftir")),
    log:
        log_of("draw_fig5_ftir"),
    benchmark:
        benchmark_of("draw_fig5_ftir")
    params:
        code=code("draw_fig5_ftir"),
        files=files,
        settings=as_settings(),
    shell:
        run_stage("draw_fig5_ftir")


rule draw_fig6_ssim:
    input:
        ssim=rules.evaluate.output.ssim,
        ceiling=rules.evaluate.output.ceiling,
        baselines=rules.score_baselines.output.baselines,
    output:
        **all_shown(figure_files("fig6_ssim")),
    log:
        log_of("draw_fig6_ssim"),
    benchmark:
        benchmark_of("draw_fig6_ssim")
    params:
        code=code("draw_fig6_ssim"),
        files=files,
        settings=as_settings(ssim=plain(STUDY.values.ssim)),
    shell:
        run_stage("draw_fig6_ssim")


rule draw_fig7_maps:
    input:
        predictions=rules.evaluate.output.predictions,
        complexity=rules.score_complexity.output.table,
        objects=[item.file for item in SHOWN],
        presses=[f"{RESULTS}/presses/grasps/{item.id}/{model}.nc" for item in SHOWN for model in STUDY.tested],
    output:
        **all_shown(figure_files("fig7_maps")),
    log:
        log_of("draw_fig7_maps"),
    benchmark:
        benchmark_of("draw_fig7_maps")
    params:
        code=code("draw_fig7_maps"),
        files=files,
        settings=as_settings(
            units=[(item.id, item.unit) for item in SHOWN],
            trials=[STUDY.readings_of(item) for item in SHOWN],
            largest_counts=STUDY.spec.largest_counts,
        ),
    shell:
        run_stage("draw_fig7_maps")


rule draw_fig8_policies:
    input:
        policies=rules.compare_policies.output.policies,
        presses=rules.compare_policies.output.presses,
    output:
        **all_shown(figure_files("fig8_policies")),
    log:
        log_of("draw_fig8_policies"),
    benchmark:
        benchmark_of("draw_fig8_policies")
    params:
        code=code("draw_fig8_policies"),
        files=files,
        settings=as_settings(),
    shell:
        run_stage("draw_fig8_policies")


rule draw_fig9_networks:
    input:
        networks=rules.compare_networks.output.networks,
        histories=learned("history.csv"),
    output:
        **all_shown(figure_files("fig9_networks")),
    log:
        log_of("draw_fig9_networks"),
    benchmark:
        benchmark_of("draw_fig9_networks")
    params:
        code=code("draw_fig9_networks"),
        files=files,
        settings=as_settings(ssim=plain(STUDY.values.ssim)),
    shell:
        run_stage("draw_fig9_networks")


if CURVES:

    rule draw_fig10_learning_curve:
        input:
            curves=CURVES,
            ceiling=rules.evaluate.output.ceiling,
        output:
            **all_shown(figure_files("fig10_learning_curve")),
        log:
            log_of("draw_fig10_learning_curve"),
        benchmark:
            benchmark_of("draw_fig10_learning_curve")
        params:
            code=code("draw_fig10_learning_curve"),
            files=files,
            settings=as_settings(ssim=plain(STUDY.values.ssim)),
        shell:
            run_stage("draw_fig10_learning_curve")


def code_file(stage):
    """The file of a stage below src/."""
    name = stage_source(f"{KIND}.{stage}").partition(":")[0]
    return f"src/{name.replace('.', '/')}.py"


def drawn_by(stage):
    """The source files that a figure's page links to: its stage, and what that draws with."""
    files = [
        path
        for path in code_files(stage)
        if ("/reporting/" in path or "/figures/" in path) and not path.endswith(("/style.py", "/render.py"))
    ]
    return [code_file(stage), *files]


def data_of(rule):
    """What a rule without wildcards reads."""
    return [path for _, paths in rule.input.items() for path in ([paths] if isinstance(paths, str) else paths)]


def data_of_material(name):
    """What a material's picture is drawn from."""
    modes = STUDY.materials[name].modes
    return [f"{RESULTS}/materials/{name}.json", *(f"{RESULTS}/curves/{name}/{mode}.csv" for mode in modes)]


SOURCES = {
    **{f"material_{name}": {"data": data_of_material(name), "code": drawn_by("draw_material")} for name in STUDY.values.materials},
    **{name: {"data": data_of(getattr(rules, f"draw_{name}")), "code": drawn_by(f"draw_{name}")} for name in (*FIGURES, *VIEWS)},
}
STAGES = [stage.partition(".")[2] for stage in stages_of(KIND, source=Path("src"))]


rule report:
    input:
        **({"limits": rules.find_limits.output.limits} if CURVES else {}),
        **({"seeds": rules.gather_seeds.output.table} if SEEDS else {}),
        **(
            {"inventory": rules.import_published.output.inventory, "counts": rules.import_published.output.counts}
            if STUDY.archive
            else {"policies": rules.compare_policies.output.policies}
        ),
        **({"gains": rules.compare_gains.output.gains} if STUDY.virtual else {}),
        sources=sorted({path for stage in STAGES for path in code_files(stage)}),
        table1=rules.make_tables.output.table1,
        contradictions=rules.make_tables.output.contradictions,
        table2=rules.make_tables.output.table2,
        table3=rules.make_tables.output.table3,
        claims=rules.make_tables.output.claims,
        summary=rules.evaluate.output.summary,
        networks=rules.compare_networks.output.networks,
        scores=rules.compare_networks.output.scores,
        levels=rules.compare_networks.output.levels,
        verdicts=rules.compare_networks.output.verdicts,
        ftir=rules.validate_ftir.output.summary,
        figures=[
            *(f"{RESULTS}/figures/material_{name}.png" for name in STUDY.values.materials),
            *(figure_files(name)["png"] for name in FIGURES[:1]),
            *(f"{RESULTS}/figures/{name}.html" for name in VIEWS),
            *(figure_files(name)["png"] for name in FIGURES[1:]),
        ],
    output:
        page=shown(f"{RESULTS}/report.html"),
        sources=f"{RESULTS}/sources.html",
        config=f"{RESULTS}/config.yaml",
        named=f"{RESULTS}/config_named.yaml",
        run=shown(f"{RESULTS}/tables/run.csv"),
        gaps=shown(f"{RESULTS}/tables/gaps.csv"),
    log:
        log_of("report"),
    benchmark:
        benchmark_of("report")
    params:
        code=code("report"),
        files=files,
        settings=as_settings(
            study=STUDY.name,
            sensor=STUDY.spec.in_words,
            seed=STUDY.values.seed,
            trials={name: STUDY.trials_of(name) for name in STUDY.items_of},
            presses={name: len(items) for name, items in STUDY.items_of.items()},
            forces_n=STUDY.values.forces_n,
            **{name: len({item.object for item in items.values()}) for name, items in STUDY.items_of.items()},
            sources=SOURCES,
            benchmarks=f"{RESULTS}/benchmarks",
            config=plain(STUDY.values),
            named=STUDY.named(),
        ),
    shell:
        run_stage("report")
