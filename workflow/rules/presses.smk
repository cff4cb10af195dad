# Every item pressed with every model, and read by the virtual sensor or from recordings of a real one.

# After each press: how many there are of all. The shell counts, for a total among the settings would rerun all when it changes.
PRESSES = len(STUDY.pressed_with) * len(STUDY.items())
TOLD = f"echo \"presses: $(find {RESULTS}/presses -name '[!.]*.nc' | wc -l) of {PRESSES} are there\" >&2"


rule simulate_press:
    input:
        unpack(model_files),
        object=lambda w: STUDY.items_of[w.set][w.item].file,
    output:
        press=f"{RESULTS}/presses/{{set}}/{{item}}/{{model}}.nc",
    log:
        log_of("simulate_press", "{set}/{item}/{model}"),
    benchmark:
        benchmark_of("simulate_press", "{set}/{item}/{model}")
    threads: 1
    resources:
        mem_mb=lambda wildcards, attempt: 3000 * attempt,
        runtime=120,
    params:
        code=code("simulate_press"),
        files=files,
        settings=lambda w: pressed_with(w.model, [STUDY.items_of[w.set][w.item]], STUDY.values.forces_n),
    shell:
        f'{run_stage("simulate_press")} && {TOLD}'


# An object in several places, with a fast model: one job, for its start takes longer than a press. Which places these are is
# the study's, so they are rules of their own without wildcards, which Snakemake prefers to the rule above.
for _model in STUDY.pressed_with:
    for _items in (_items for _items in STUDY.press_jobs(_model) if len(_items) > 1):
        _first = f"{_items[0].set}/{_items[0].id}"

        rule:
            name:
                rule_name("simulate_presses", _model, _first)
            input:
                **needs_of(_model),
                object=_items[0].file,
            output:
                press=[f"{RESULTS}/presses/{_item.set}/{_item.id}/{_model}.nc" for _item in _items],
            log:
                log_of("simulate_presses", f"{_first}/{_model}"),
            benchmark:
                benchmark_of("simulate_presses", f"{_first}/{_model}")
            threads: 1
            params:
                code=code("simulate_presses"),
                files=files,
                settings=pressed_with(_model, _items, STUDY.values.forces_n),
            shell:
                f'{run_stage("simulate_presses")} && {TOLD}'


# A grasped object once more with each tested model: are maps deterministic? One in a single place, where there is one: in several
# places at once the elastic model's maps are summed up together, whose last bits are not those of a press alone.
GRASPED = list(STUDY.items_of["grasps"].values())
FIRST = next(
    (item for item in GRASPED if all([item] in STUDY.press_jobs(model) for model in STUDY.tested)),
    GRASPED[0],
)


rule repeat_press:
    input:
        unpack(model_files),
        object=FIRST.file,
    output:
        press=f"{RESULTS}/repeated/{{model}}.nc",
    log:
        log_of("repeat_press", "{model}"),
    benchmark:
        benchmark_of("repeat_press", "{model}")
    threads: 1
    params:
        code=code("simulate_press"),
        files=files,
        settings=lambda w: pressed_with(w.model, [FIRST], STUDY.values.forces_n),
    shell:
        run_stage("simulate_press")


if STUDY.virtual:

    rule read_virtual_sensor:
        input:
            press=f"{RESULTS}/presses/{{set}}/{{item}}/{STUDY.values.reference}.nc",
        output:
            tactile=f"{RESULTS}/tactile/{{set}}/{{item}}.nc",
        log:
            log_of("read_virtual_sensor", "{set}/{item}"),
        benchmark:
            benchmark_of("read_virtual_sensor", "{set}/{item}")
        params:
            code=code("read_virtual_sensor"),
            files=files,
            settings=lambda w: as_settings(
                sensor=STUDY.sensor,
                virtual_sensor=STUDY.values.virtual_sensor,
                trials=STUDY.trials_of(w.set),
                seed=STUDY.values.seed,
            ),
        shell:
            run_stage("read_virtual_sensor")

else:

    rule read_recordings:
        input:
            recordings=lambda w: [one.file for one in STUDY.recordings[f"{w.set}/{w.item}"]],
            force_logs=lambda w: [one.force_log for one in STUDY.recordings[f"{w.set}/{w.item}"]],
        output:
            tactile=f"{RESULTS}/tactile/{{set}}/{{item}}.nc",
        log:
            log_of("read_recordings", "{set}/{item}"),
        benchmark:
            benchmark_of("read_recordings", "{set}/{item}")
        priority: 1  # before the presses: an unusable recording is refused in the first minute
        params:
            code=code("read_recordings"),
            files=files,
            settings=lambda w: as_settings(
                sensor=STUDY.sensor,
                set=w.set,
                item=w.item,
                forces_n=STUDY.values.forces_n,
                fingers=[one.finger for one in STUDY.recordings[f"{w.set}/{w.item}"]],
                baselines=[one.baseline for one in STUDY.recordings[f"{w.set}/{w.item}"]],
            ),
        shell:
            run_stage("read_recordings")


rule press_section:
    input:
        **needs_of(STUDY.values.choice.models["hyperelastic"]),
        object=STUDY.section_item.file,
    output:
        body=f"{RESULTS}/section/pressed_sensor.vtu",
        summary=f"{RESULTS}/section/press.json",
    log:
        log_of("press_section"),
    benchmark:
        benchmark_of("press_section")
    params:
        code=code("press_section"),
        files=files,
        settings=pressed_with(STUDY.values.choice.models["hyperelastic"], [STUDY.section_item], [STUDY.values.section.force_n]),
    shell:
        run_stage("press_section")
