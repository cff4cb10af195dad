# Every item pressed with every model, and read by the virtual sensor.

# After each press: how many there are of all. The shell counts, for a total among the settings would rerun all when it changes.
PRESSES = len(STUDY.pressed_with) * len(STUDY.items())
TOLD = f"echo \"presses: $(find {RESULTS}/presses -name '[!.]*.nc' | wc -l) of {PRESSES} are there\" >&2"


rule simulate_press:
    input:
        unpack(model_files),
        code=code("simulate_press"),
        object=lambda w: STUDY.items_of[w.set][w.item].file,
    output:
        press=f"{RESULTS}/presses/{{set}}/{{item}}/{{model}}.nc",
    params:
        files=files,
        settings=lambda w: pressed_with(w.model, STUDY.items_of[w.set][w.item], STUDY.values.forces_n),
    log:
        log_of("simulate_press", "{set}/{item}/{model}"),
    benchmark:
        benchmark_of("simulate_press", "{set}/{item}/{model}")
    threads: 1
    shell:
        f'{run_stage("simulate_press")} && {TOLD}'


rule read_virtual_sensor:
    input:
        code=code("read_virtual_sensor"),
        press=f"{RESULTS}/presses/{{set}}/{{item}}/{STUDY.values.reference}.nc",
    output:
        tactile=f"{RESULTS}/tactile/{{set}}/{{item}}.nc",
    params:
        files=files,
        settings=lambda w: as_settings(
            sensor=STUDY.sensor,
            virtual_sensor=STUDY.values.virtual_sensor,
            trials=STUDY.trials_of(w.set),
            seed=STUDY.values.seed,
        ),
    log:
        log_of("read_virtual_sensor", "{set}/{item}"),
    benchmark:
        benchmark_of("read_virtual_sensor", "{set}/{item}")
    shell:
        run_stage("read_virtual_sensor")


rule press_section:
    input:
        **needs_of(STUDY.values.choice.models["hyperelastic"]),
        code=code("press_section"),
        object=STUDY.section_item.file,
    output:
        body=f"{RESULTS}/section/pressed_sensor.vtu",
        summary=f"{RESULTS}/section/press.json",
    params:
        files=files,
        settings=pressed_with(
            STUDY.values.choice.models["hyperelastic"], STUDY.section_item, [STUDY.values.section.force_n]
        ),
    log:
        log_of("press_section"),
    benchmark:
        benchmark_of("press_section")
    shell:
        run_stage("press_section")
