# What each model of the sensor needs once, before any press.

rule mesh_sensor:
    input:
        code=code("mesh_sensor"),
    output:
        mesh=f"{RESULTS}/sensor/{{model}}/mesh.vtu",
    params:
        files=files,
        settings=lambda w: as_settings(sensor=STUDY.sensor, model=w.model, mesh=mesh_of(w.model)),
    log:
        log_of("mesh_sensor", "{model}"),
    benchmark:
        benchmark_of("mesh_sensor", "{model}")
    shell:
        run_stage("mesh_sensor")


rule precompute_compliance:
    input:
        code=code("precompute_compliance"),
        mesh=f"{RESULTS}/sensor/{{model}}/mesh.vtu",
    output:
        compliance=f"{RESULTS}/sensor/{{model}}/compliance.npz",
    params:
        files=files,
        settings=as_settings(sensor=STUDY.sensor),
    threads: 2
    log:
        log_of("precompute_compliance", "{model}"),
    benchmark:
        benchmark_of("precompute_compliance", "{model}")
    shell:
        run_stage("precompute_compliance")
