"""How the page looks: one column of text, quiet tables, cards in as many columns as fit; light or dark as the reader has it."""

STYLE = """
:root { color-scheme: light dark; --paper: #fbfaf7; --ink: #1f1e1b; --quiet: #66625a; --line: #dfdbd2; --card: #ffffff;
  --ours: #22634a; --theirs: #8a5a12; --bad: #a02f1b; --fell: #fbeae5; --band: #22634a2b; --hover: #f1eee7; }
@media (prefers-color-scheme: dark) { :root { --paper: #171614; --ink: #e8e4dc; --quiet: #a7a196; --line: #383530; --card: #1f1e1b;
  --ours: #83c9a8; --theirs: #d9ab62; --bad: #f19a84; --fell: #3a211b; --band: #83c9a833; --hover: #292723; } }
* { box-sizing: border-box; }
html { scroll-behavior: smooth; scroll-padding-top: 1rem; }
body { margin: 0 auto; padding: 2rem clamp(1rem, 4vw, 3rem) 4rem; max-width: 84rem; background: var(--paper); color: var(--ink);
  font: 1rem/1.5 system-ui, -apple-system, "Segoe UI", Roboto, "Noto Sans", sans-serif; overflow-wrap: anywhere; }
h1, h2, h3, .caption { font-family: "Iowan Old Style", "Palatino Linotype", Palatino, "Noto Serif", Georgia, serif; font-weight: 600; }
h1 { font-size: clamp(1.7rem, 4vw, 2.4rem); line-height: 1.15; margin: 0 0 .5rem; text-wrap: balance; }
h2 { font-size: 1.4rem; margin: 3rem 0 .75rem; }
h3 { font-size: 1.05rem; margin: 1.5rem 0 .25rem; }
p { margin: .4rem 0; max-width: 72ch; }
a { color: var(--ours); text-underline-offset: .15em; }
small { font-size: .8em; color: var(--quiet); }
.quiet, figcaption, caption, .facts { color: var(--quiet); }
.bad { color: var(--bad); }
td:first-child .bad, .verdict span { white-space: nowrap; }
.right { color: var(--ours); font-weight: 600; }
.facts { display: flex; flex-wrap: wrap; gap: .2rem 1.5rem; margin: 0; padding: 0; font-size: .9rem; }
.facts div { display: flex; gap: .4em; } .facts dd { margin: 0; color: var(--ink); }
nav { display: flex; flex-wrap: wrap; gap: .2rem 1.2rem; margin: 1rem 0 0; padding: .5rem 0; border-block: 1px solid var(--line); }
:focus-visible { outline: 2px solid var(--ours); outline-offset: 2px; border-radius: 3px; }
.skip { position: absolute; left: -100vw; } .skip:focus { position: static; }
.scrolling { overflow-x: auto; margin: .75rem 0 1.5rem; }
table { border-collapse: collapse; overflow-wrap: break-word; font-size: .92rem; font-variant-numeric: tabular-nums; }
caption { text-align: left; padding-bottom: .4rem; } caption b { color: var(--ink); }
th, td { padding: .34rem .8rem .34rem 0; text-align: left; vertical-align: baseline; border-bottom: 1px solid var(--line); }
thead th { font-weight: 600; vertical-align: bottom; border-bottom-color: var(--quiet); color: var(--quiet); white-space: nowrap; }
thead th[colspan] { border-bottom: 1px solid var(--line); }
tbody th { font-weight: 500; }
.results :is(th, td) { padding-right: .6rem; }
.results tbody th { position: sticky; left: 0; background: var(--paper); min-width: 9rem; z-index: 1; }
.failures tbody th { min-width: 10rem; } .failures td:last-child { min-width: 16rem; }
.results .number, .night .number { white-space: nowrap; }
td.none { color: var(--quiet); }
td.chart { vertical-align: middle; }
tbody tr:hover :is(th, td) { background: var(--hover); }
tr.fell :is(th, td) { background: var(--fell); }
th button { font: inherit; color: inherit; background: none; border: 0; padding: 0; text-align: inherit; }
.scripted th button { cursor: pointer; } .scripted th button:hover { color: var(--ink); text-decoration: underline; }
th[aria-sort=ascending] button::after { content: " ↑"; } th[aria-sort=descending] button::after { content: " ↓"; }
svg { display: block; overflow: visible; }
.dots { width: 132px; height: 22px; }
.plot { width: 100%; height: auto; }
.grid { stroke: var(--line); stroke-width: 1; }
.tick { fill: var(--quiet); font: 9px system-ui, sans-serif; } .tick.end { text-anchor: end; }
.curve { fill: none; stroke: var(--ours); stroke-width: 1.5; stroke-linejoin: round; }
.band { fill: var(--band); } .dot { fill: var(--ours); } .whisker { stroke: var(--ours); stroke-width: 2; }
.dot.paper { fill: var(--paper); stroke: var(--theirs); stroke-width: 1.5; } .whisker.paper { stroke: var(--theirs); stroke-width: 1; }
.key { display: inline-block; width: .65em; height: .65em; border-radius: 50%; background: var(--ours); margin-right: .3em; }
.key.paper { background: none; border: 2px solid var(--theirs); }
.curves { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(15rem, 100%), 1fr)); gap: .5rem 1.5rem; }
figure { margin: 0; } figcaption { font-size: .85rem; }
.curves figure { max-width: 26rem; }
.filter { display: flex; flex-wrap: wrap; gap: .6rem 1.2rem; align-items: center; margin: .75rem 0 1.25rem; }
.filter :is(input[type=search], select) { font: inherit; color: inherit; background: var(--card); border: 1px solid var(--quiet);
  border-radius: 4px; padding: .25rem .5rem; max-width: 100%; }
.filter output { color: var(--quiet); margin-left: auto; }
html:not(.scripted) .scripted-only { display: none; }
.gallery { list-style: none; margin: 0; padding: 0; display: grid; gap: 1.25rem;
  grid-template-columns: repeat(auto-fill, minmax(min(13.5rem, 100%), 1fr)); align-items: start; }
.card { background: var(--card); border: 1px solid var(--line); border-radius: 6px; padding: .6rem; content-visibility: auto;
  contain-intrinsic-size: auto 23rem; font-size: .9rem; min-width: 0; }
.card p { margin: .3rem 0 0; }
.card .caption { font-size: 1.05rem; line-height: 1.3; margin-top: .6rem; }
.picture { display: block; width: 100%; padding: 0; border: 0; background: #cccccc; aspect-ratio: 1; border-radius: 3px; overflow: hidden; }
button.picture { cursor: pointer; }
.picture img { display: block; width: 100%; height: 100%; object-fit: cover; }
.picture.empty { display: grid; place-items: center; background: var(--hover); color: var(--quiet); }
.links { display: flex; flex-wrap: wrap; gap: .1rem .9rem; }
details { margin-top: .5rem; } summary { cursor: pointer; color: var(--quiet); }
.card table { font-size: .78rem; width: 100%; margin-top: .5rem; } .card :is(th, td) { padding-right: .4rem; white-space: normal; }
@media (max-width: 34rem) { body { padding-top: 1.2rem; } h2 { margin-top: 2.2rem; } .filter label { width: 100%; }
  .filter :is(input[type=search], select) { width: 100%; } .filter output { margin-left: 0; }
  .results tbody th { min-width: 6.5rem; max-width: 8rem; } .results .chart, .key-line { display: none; }
  .gallery { grid-template-columns: repeat(2, minmax(0, 1fr)); gap: .7rem; }
  .card { padding: .45rem; } .card .caption { font-size: .95rem; } }
@media print { .filter, nav { display: none; } .card { break-inside: avoid; } }
@media (prefers-reduced-motion: reduce) { html { scroll-behavior: auto; } }
"""
