"""The report's page as a Jinja template; `page` fills it."""

STYLE = """body{font:16px/1.5 system-ui,sans-serif;max-width:1080px;margin:2em auto;padding:0 1em;color:#222}
h1,h2{line-height:1.2}table{border-collapse:collapse;font-size:13px;margin:1em 0;display:block;overflow-x:auto}
td,th{border-bottom:1px solid #ddd;padding:4px 8px;text-align:left;vertical-align:top}th{background:#f4f4f4}
figure{margin:2em 0}img{max-width:100%}figcaption,.links{font-size:14px;color:#444}nav a{margin-right:1em}
.box{background:#fff6e0;border-left:4px solid #e0a000;padding:.6em 1em}.reproduced{background:#d9f0d9}.not{background:#f7d7d7}
.contradicts{background:#ffe9c7}.needs{background:#e6e6f5}.undecided{background:#eee}
.consistent{background:#e4eef8}summary{cursor:pointer}
figure .links{margin-top:.4em}
pre{font-size:12px;line-height:1.35;background:#f8f8f8;padding:1em;overflow-x:auto}"""

PAGE = """<!doctype html><html lang="en"><head><meta charset="utf-8"><title>softtact: {{ study }}</title>
<meta name="viewport" content="width=device-width"><style>{{ style }}</style></head><body>
<h1>Simulating a soft tactile sensor: the study <i>{{ study }}</i></h1>
{% for said in verdicts_on_networks %}<p{% if said.startswith("Not trained") %} class="box"{% endif %}>{{ said }}</p>{% endfor %}
<div class="box"><b>What is not here.</b><ul>{% for said in missing %}<li>{{ said }}</li>{% endfor %}</ul></div>
<p class="box"><b>What is synthetic here.</b> {{ synthetic }}</p>
<nav><a href="#figures">Figures</a><a href="#result">Result</a><a href="#tables">Tables</a><a href="#claims">Claims</a>
<a href="#run">What was run</a><a href="{{ config }}">Configuration</a><a href="{{ sources }}">Code</a></nav>
<p>{{ facts }}</p>
<h2 id="figures">Figures</h2>{% for f in figures %}<figure id="{{ f.name }}">
{% if f.html %}{{ f.html }}{% else %}<img alt="{{ f.caption }}" src="data:image/png;base64,{{ f.image }}">{% endif %}
<figcaption>{{ f.caption }} {{ f.said }}</figcaption>
<div class="links">{% for text, link in f.files %}<a href="{{ link }}">{{ text }}</a>{{ ", " if not loop.last }}{% endfor %}.
Data: {% for text, link in f.data[:4] %}<a href="{{ link }}">{{ text }}</a>{{ ", " if not loop.last }}{% endfor %}
{%- if f.data|length > 4 %}<details><summary>and {{ f.data|length - 4 }} more files</summary>
{% for text, link in f.data[4:] %}<a href="{{ link }}">{{ text }}</a> {% endfor %}</details>{% else %}.{% endif %}
Code: {% for text, link in f.code %}<a href="{{ link }}">{{ text }}</a>{{ ", " if not loop.last }}{% endfor %}.
<a href="{{ config }}">Configuration</a>.</div></figure>{% endfor %}
<h2 id="result">Result in one table</h2>
<p>Grasped objects: at the largest force, the paper's test 2, and over all forces. Skill is (score - best trivial) / (ceiling - best
trivial) of the mean SSIM; below 0, that predictor reads better than the network. All sets and forces:
<a href="{{ result_link }}">CSV</a>.</p>{{ result }}
<h2 id="tables">Tables</h2>{% for t in tables %}<h3>{{ t.title }}</h3>{{ t.html }}
<p class="links"><a href="{{ t.link }}">CSV</a>. Code: <a href="{{ t.code[1] }}">{{ t.code[0] }}</a>.
<a href="{{ config }}">Configuration</a>.</p>{% endfor %}
<h2 id="claims">The paper's claims</h2><p>Each verdict is computed by the rule beside it: {{ verdicts }}.
<a href="{{ claims_link }}">CSV</a>. Code: <a href="{{ claims_code[1] }}">{{ claims_code[0] }}</a>.</p>
<table><tr>{% for c in claim_columns %}<th>{{ header(c) }}</th>
{% endfor %}</tr>{% for row in claims %}<tr class="{{ row.verdict.split()[0] }}">{% for c in claim_columns %}<td>
{%- if c == "evidence" and row.link %}<a href="{{ row.link }}">{{ row[c] }}</a>{% else %}{{ row[c] }}{% endif %}</td>
{% endfor %}</tr>{% endfor %}</table>
<h2 id="run">What was run, on what, how long</h2><p>{{ run_said }}</p>{{ run }}
<p class="links">Data: <a href="{{ run_link }}">CSV</a>. Each job's own: <a href="benchmarks">benchmarks</a>,
<a href="logs">logs</a>.</p>
<p>softtact {{ version }}; {{ machine }}. Folders: {% for name in folders %}<a href="{{ name }}">{{ name }}</a>
{{- ", " if not loop.last }}{% endfor %}.</p></body></html>
"""

SOURCES = """<!doctype html><html lang="en"><head><meta charset="utf-8"><title>softtact: code of {{ study }}</title>
<style>{{ style }}</style></head><body>
<h1>Configuration and code of the study <i>{{ study }}</i></h1>
<p>As they were when the <a href="{{ page }}">report</a> was made, by softtact {{ version }}.</p>
<h2 id="config">Configuration</h2><p>With all defaults; as a file: <a href="config.yaml">config.yaml</a>, which runs the same study
by <code>snakemake --configfile config.yaml</code>; what it names (sensor, materials, objects):
<a href="config_named.yaml">config_named.yaml</a>.</p><pre>{{ config }}</pre><h2 id="named">What it names</h2><pre>{{ named }}</pre>
<h2>Code</h2><ul>{% for name, _ in files %}<li><a href="#{{ name }}">{{ name }}</a></li>{% endfor %}</ul>
{% for name, text in files %}<h3 id="{{ name }}">{{ name }}</h3><pre>{{ text }}</pre>{% endfor %}</body></html>
"""
