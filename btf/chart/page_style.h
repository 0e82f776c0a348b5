// What the charts' pages look like alike; each adds its own.
#pragma once

namespace tessera {

inline constexpr char kChartStyle[] = R"(
h1 { font-size: 2em; margin-bottom: .2em; }
h2 { font-size: 1.5em; margin-top: 2.2em; border-bottom: 2px solid #1f2328; padding-bottom: .2em; }
h3 { font-size: 1.1em; margin: 1.8em 0 .4em; }
p.lead, p.facts { color: #57606a; max-width: 62em; }
ul li { margin: .25em 0; max-width: 72em; }
.legend { display: flex; flex-wrap: wrap; gap: .2em 1.4em; margin: .6em 0; align-items: center; }
.legend span { display: inline-flex; align-items: center; gap: .4em; }
.plots { display: flex; flex-wrap: wrap; gap: 6px; }
details { margin: 1em 0; }
summary { cursor: pointer; font-weight: 600; }
.wide { overflow-x: auto; }
)";

}  // namespace tessera
