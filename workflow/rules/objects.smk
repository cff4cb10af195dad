# How complex each object is, and which model that asks for.


rule score_complexity:
    input:
        meshes=[item.file for item in STUDY.items()],
    output:
        table=f"{RESULTS}/objects/complexity.csv",
    log:
        log_of("score_complexity"),
    benchmark:
        benchmark_of("score_complexity")
    params:
        code=code("score_complexity"),
        files=files,
        settings=as_settings(
            objects=[{"name": item.id, "unit": item.unit, "pose": item.pose} for item in STUDY.items()],
            footprint_mm=STUDY.spec.footprint_mm,
            reach_mm=STUDY.spec.thickness_mm,
            **plain(STUDY.values.complexity),
        ),
    shell:
        run_stage("score_complexity")
