rule report:
    input:
        code=code("report"),
        ssim=rules.evaluate.output.ssim,
        area=rules.validate_ftir.output.area,
        complexity=rules.score_complexity.output.table,
    output:
        page=f"{RESULTS}/report.html",
    params:
        files=files,
        settings=as_settings(),
    log:
        log_of("report"),
    benchmark:
        benchmark_of("report")
    shell:
        run_stage("report")
