# Test curves -> fitted laws.

rule make_curves:
    input:
        code=code("make_curves"),
        measured=lambda w: STUDY.materials[w.material].measured_files,
    output:
        curves=f"{RESULTS}/curves/{{material}}/{{mode}}.csv",
    params:
        files=files,
        settings=lambda w: as_settings(**STUDY.materials[w.material].curve_settings),
    log:
        log_of("make_curves", "{material}/{mode}"),
    benchmark:
        benchmark_of("make_curves", "{material}/{mode}")
    shell:
        run_stage("make_curves")


rule fit_material:
    input:
        code=code("fit_material"),
        curves=lambda w: [
            f"{RESULTS}/curves/{w.material}/{mode}.csv" for mode in STUDY.materials[w.material].modes
        ],
    output:
        card=f"{RESULTS}/materials/{{material}}.json",
    params:
        files=files,
        settings=lambda w: as_settings(**STUDY.materials[w.material].fit_settings),
    log:
        log_of("fit_material", "{material}"),
    benchmark:
        benchmark_of("fit_material", "{material}")
    shell:
        run_stage("fit_material")
