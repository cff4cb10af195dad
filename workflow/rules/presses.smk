# Every item pressed with every model, and read by the virtual sensor.

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
        run_stage("simulate_press")


rule read_virtual_sensor:
    input:
        code=code("read_virtual_sensor"),
        press=f"{RESULTS}/presses/{{set}}/{{item}}/{STUDY.values.reference}.nc",
    output:
        tactile=f"{RESULTS}/tactile/{{set}}/{{item}}.nc",
    params:
        files=files,
        settings=as_settings(
            sensor=STUDY.sensor,
            virtual_sensor=STUDY.values.virtual_sensor,
            trials=STUDY.values.trials,
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
