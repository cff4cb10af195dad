# What each model of the sensor needs once, before any press.


rule mesh_sensor:
    output:
        mesh=f"{RESULTS}/sensor/{{model}}/mesh.vtu",
    log:
        log_of("mesh_sensor", "{model}"),
    benchmark:
        benchmark_of("mesh_sensor", "{model}")
    params:
        code=code("mesh_sensor"),
        files=files,
        settings=lambda w: as_settings(
            sensor=STUDY.sensor, model=w.model, kind=STUDY.values.models[w.model].kind, mesh=mesh_of(w.model)
        ),
    shell:
        run_stage("mesh_sensor")


rule frustum_law:
    input:
        card_dielectric=card_of("dielectric"),
    output:
        law=f"{RESULTS}/sensor/{{model}}/frustum_law.npz",
    log:
        log_of("frustum_law", "{model}"),
    benchmark:
        benchmark_of("frustum_law", "{model}")
    params:
        code=code("frustum_law"),
        files=files,
        settings=lambda w: as_settings(
            sensor=STUDY.sensor, law=STUDY.values.models[w.model].laws.get("dielectric"), mesh=mesh_of(w.model)
        ),
    shell:
        run_stage("frustum_law")


rule precompute_compliance:
    input:
        unpack(compliance_files),
    output:
        compliance=f"{RESULTS}/sensor/{{model}}/compliance.npz",
    log:
        log_of("precompute_compliance", "{model}"),
    benchmark:
        benchmark_of("precompute_compliance", "{model}")
    threads: 1  # on more, the solver sums in another order: files would differ in the last digit
    resources:
        mem_mb=lambda wildcards, attempt: 3000 * attempt,
        runtime=60,
    params:
        code=code("precompute_compliance"),
        files=files,
        settings=lambda w: as_settings(
            sensor=STUDY.sensor, kind=STUDY.values.models[w.model].kind, laws=STUDY.values.models[w.model].laws
        ),
    shell:
        run_stage("precompute_compliance")
