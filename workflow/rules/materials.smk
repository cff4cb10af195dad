# Test curves -> fitted laws.


rule make_curves:
    input:
        measured=lambda w: STUDY.materials[w.material].measured_files,
    output:
        curves=f"{RESULTS}/curves/{{material}}/{{mode}}.csv",
    log:
        log_of("make_curves", "{material}/{mode}"),
    benchmark:
        benchmark_of("make_curves", "{material}/{mode}")
    params:
        code=code("make_curves"),
        files=files,
        settings=lambda w: as_settings(**STUDY.materials[w.material].curve_settings),
    shell:
        run_stage("make_curves")


rule fit_material:
    input:
        curves=lambda w: [f"{RESULTS}/curves/{w.material}/{mode}.csv" for mode in STUDY.materials[w.material].modes],
    output:
        card=f"{RESULTS}/materials/{{material}}.json",
    log:
        log_of("fit_material", "{material}"),
    benchmark:
        benchmark_of("fit_material", "{material}")
    params:
        code=code("fit_material"),
        files=files,
        settings=lambda w: as_settings(**STUDY.materials[w.material].fit_settings),
    shell:
        run_stage("fit_material")


rule draw_material:
    input:
        card=rules.fit_material.output.card,
        curves=rules.fit_material.input.curves,
    output:
        png=shown(f"{RESULTS}/figures/material_{{material}}.png"),
        svg=f"{RESULTS}/figures/material_{{material}}.svg",
    log:
        log_of("draw_material", "{material}"),
    benchmark:
        benchmark_of("draw_material", "{material}")
    params:
        code=code("draw_material"),
        files=files,
        settings=as_settings(),
    shell:
        run_stage("draw_material")
