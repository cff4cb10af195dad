"""Style, script and template of the reports: one look for all, for screens of 400 px and more, with nothing from elsewhere."""

from jinja2 import Environment
from markupsafe import Markup

STYLE = Markup("""*{box-sizing:border-box}
body{font:16px/1.5 system-ui,sans-serif;max-width:1200px;margin:0 auto;padding:1.5em 1em 3em;color:#222;overflow-wrap:break-word}
h1,h2,h3{line-height:1.2}h2{margin-top:2em;border-bottom:1px solid #ddd;padding-bottom:.2em}h3{margin-bottom:.4em}a{color:#1f4e79}
.opening{columns:2;column-gap:1em;margin:1em 0 0}
.opening section{break-inside:avoid;background:#f3f6f9;border-top:4px solid #1f4e79;padding:.7em 1em;margin-bottom:1em}
.opening .synthetic{background:#fff6e0;border-color:#e0a000}
.opening h2{font-size:1.05em;margin:0 0 .4em;border:0;padding:0}.opening p{margin:.4em 0}
ul{padding-left:1.2em;margin:.4em 0}li{margin:.25em 0}
nav{margin:1.5em 0}nav a{display:inline-block;margin:.2em 1.2em .2em 0}
.table{overflow-x:auto;margin:.6em 0;border:1px solid #ddd}
table{border-collapse:collapse;font-size:13px;width:max-content;min-width:100%}.claims{width:100%}
td,th{border-bottom:1px solid #ddd;padding:5px 9px;text-align:left;vertical-align:top;max-width:30em}
th{background:#f3f6f9;line-height:1.3;vertical-align:bottom;max-width:9em}
.claims td:nth-child(4),.claims td:nth-child(7){min-width:17em}
td.number,th.number{text-align:right;font-variant-numeric:tabular-nums;white-space:nowrap}th.number{white-space:normal;min-width:5em}
figure{margin:2em 0}figure>button{display:block;width:100%;padding:0;border:0;background:none;cursor:zoom-in}
figure>button:focus-visible{outline:3px solid #1f4e79}img{max-width:100%;display:block;margin:0 auto}
figcaption{margin-top:.5em}figcaption,.links{font-size:14px;color:#444}.links{margin:.3em 0 1.5em}figure .links{margin:.3em 0}
a,summary{overflow-wrap:anywhere}summary{cursor:pointer}
.reproduced{background:#d9f0d9}.not{background:#f7d7d7}.contradicts{background:#ffe9c7}.needs{background:#e6e6f5}
.undecided{background:#eee}.consistent{background:#e4eef8}
pre{font-size:12px;line-height:1.35;background:#f8f8f8;padding:1em;overflow-x:auto}
footer{margin-top:3em;font-size:14px;color:#444;border-top:1px solid #ddd;padding-top:.6em}
dialog{width:100vw;height:100vh;max-width:none;max-height:none;border:0;padding:0;background:#fff;overflow:auto}
dialog img{max-width:none;min-width:100%;margin:0}
dialog button{position:fixed;top:.5em;right:.5em;font:16px system-ui;padding:.4em .8em;background:#fff;border:1px solid #888}
@media(max-width:760px){.opening{columns:1}h1{font-size:1.6em}
.claims,.claims tbody,.claims tr,.claims td{display:block;width:100%;max-width:none}.claims tr:first-child{display:none}
.claims tr{border-bottom:3px solid #fff;padding:.4em 0}.claims td{border:0;padding:2px 9px}
.claims td+td::before{content:attr(data-heading) ": ";color:#555}.claims td:first-child{font-weight:bold}
.claims td:empty{display:none}.claims td:nth-child(n){min-width:0}}
@media print{dialog,nav{display:none}.table{overflow:visible}}""")

# A click on a figure shows the same picture in its full size; Escape, the button or a click closes it.
SCRIPT = Markup("""(function(){var large=document.querySelector("dialog");
document.querySelectorAll("figure>button").forEach(function(button){button.onclick=function(){
var image=button.querySelector("img"),copy=large.querySelector("img");copy.src=image.src;copy.alt=image.alt;
large.showModal();large.scrollTo(0,0);};});
large.onclick=function(){large.close();};})();""")

TEMPLATE = Environment(autoescape=True, trim_blocks=True).from_string("""
{%- macro addresses(pairs) -%}
{% for text, address in pairs %}<a href="{{ address }}">{{ text }}</a>{{ ", " if not loop.last }}{% endfor %}
{%- endmacro %}
{%- macro linked(groups, most=none) %}
{% for label, pairs in groups if pairs %}{{ label ~ ": " if label }}{{ addresses(pairs[:most]) -}}
{% if most and pairs|length > most %}<details><summary>and {{ pairs|length - most }} more files</summary>
{{ addresses(pairs[most:]) }}</details>{% else %}.{% endif %}

{% endfor %}{% endmacro -%}
{%- macro sentence(item) -%}
{{ item.text }}{% if item.address %} (<a href="{{ item.address }}">numbers</a>){% endif %}
{%- endmacro -%}
<!doctype html><html lang="en"><head><meta charset="utf-8"><title>softtact: {{ title }} {{ name }}</title>
<meta name="viewport" content="width=device-width"><style>{{ style }}</style></head><body>
<h1>{{ title }} <i>{{ name }}</i></h1>
{% for part in parts %}
{% if part.kind == "navigation" %}
<nav>{% for text, address in part.links %}<a href="{{ address }}">{{ text }}</a>{% endfor %}</nav>
{% elif part.kind == "opening" %}
<div class="opening">{% for heading, style, items in part.blocks %}<section class="{{ style }}"><h2>{{ heading }}</h2>
{% if items|length == 1 %}<p>{{ sentence(items[0]) }}</p>{% else %}<ul>{% for item in items %}<li>{{ sentence(item) }}</li>
{% endfor %}</ul>{% endif %}
</section>{% endfor %}</div>
{% elif part.kind == "section" %}
<h2 id="{{ part.anchor }}">{{ part.title }}</h2>
{% elif part.kind == "text" %}
<p>{{ part.text }} {{ linked(part.links) }}</p>
{% elif part.kind == "figure" %}
<figure id="{{ part.anchor }}">
{% if part.html %}{{ part.html }}{% else %}<button title="Show large"><img alt="{{ part.caption }}"
 src="data:image/png;base64,{{ part.image }}"></button>{% endif %}

<figcaption>{{ part.caption }} {{ part.remark }}</figcaption><div class="links">{{ linked(part.links, most) }}</div></figure>
{% elif part.kind == "table" %}
{% if part.title %}<h3>{{ part.title }}</h3>{% endif %}
<div class="table"><table><tr>{% for heading in part.headings %}<th{{ " class=number" if heading[1] }}>{{ heading[0] }}</th>
{% endfor %}</tr>
{% for row in part.rows %}<tr>{% for value in row %}<td{{ " class=number" if part.headings[loop.index0][1] }}>{{ value }}</td>
{% endfor %}</tr>
{% endfor %}</table></div>
<p class="links">{{ part.remark }} {{ linked(part.links) }}</p>
{% elif part.kind == "claims" %}
<div class="table"><table class="claims"><tr>{% for name in part.columns %}<th>{{ header(name) }}</th>{% endfor %}</tr>
{% for row in part.rows %}<tr class="{{ row.verdict.split()[0] }}">{% for name in part.columns %}
<td data-heading="{{ header(name) }}">
{%- if name == "evidence" and row.link %}<a href="{{ row.link }}">{{ row[name].split("/")[-1] }}</a>
{%- else %}{{ row[name] }}{% endif -%}
</td>
{% endfor %}</tr>
{% endfor %}</table></div>
{% else %}
{% if part.title %}<h3 id="{{ part.anchor }}">{{ part.title }}</h3>{% endif %}<pre>{{ part.text }}</pre>
{% endif %}
{% endfor %}
<footer>softtact {{ version }}; {{ machine }}.</footer>
<dialog><button>Close</button><img alt=""></dialog><script>{{ script }}</script></body></html>
""")
