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
        settings=lambda w: as_settings(
            item=press_settings(STUDY.items_of[w.set][w.item]),
            sensor=STUDY.sensor,
            model=w.model,
            kind=STUDY.values.models[w.model].kind,
            laws=STUDY.values.models[w.model].laws,
            mesh=mesh_of(w.model),
            friction=friction_of(w.model),
            forces_n=STUDY.values.forces_n,
        ),
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
