// Minimum cuts of left-to-right seam graphs: GridCut and BorderCut against Boost.Graph's Boykov-Kolmogorov
// [Boykov2004] on a compressed sparse row graph with float capacities (whole numbers: all three cut the same
// graph, and floats add them exactly). Each side's time includes building its graph from the same arrays.
// Prints `name,value,unit,limit,verdict`; exits 1 when a limit is missed or two cuts disagree.
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <utility>
#include <vector>

#include <boost/graph/boykov_kolmogorov_max_flow.hpp>
#include <boost/graph/compressed_sparse_row_graph.hpp>

#include "btf/base/rng.h"
#include "btf/tiles/border_cut.h"
#include "btf/tiles/max_flow.h"

namespace {

using tessera::BorderCut;
using tessera::GridCut;
using tessera::Rng;

constexpr int kRounds = 15;
// Boost's time over ours, at least, from these sizes on.
constexpr double kMinGridRatio = 1.5;
constexpr int kSmallestGrid = 64;
constexpr double kMinBorderRatio = 10.0;
constexpr int kSmallestBorder = 128;

// Undirected capacities by y * size + x; the left column is pinned to the source, the right one to the sink.
struct SeamGraph {
  int size = 0;
  std::vector<int> right, down;
};

// Seam costs |A(p) - B(p)| + |A(q) - B(q)| [Kwatra2003] of two unrelated patches of smoothed noise.
SeamGraph MakeSeamGraph(int size, uint64_t seed) {
  constexpr int kDims = 8;
  constexpr int kBlurs = 2;
  constexpr double kScale = 2000.0;
  const size_t count = static_cast<size_t>(size) * size;
  Rng rng(seed);
  std::vector<double> squares(count, 0.0);
  for (int dim = 0; dim < kDims; ++dim) {
    std::vector<double> noise(count);
    for (double& value : noise) {
      value = rng.NextDouble() - 0.5;
    }
    for (int blur = 0; blur < kBlurs; ++blur) {
      std::vector<double> smooth(count, 0.0);
      for (int i = 0; i < static_cast<int>(count); ++i) {
        for (int step = 0; step < 9; ++step) {
          const int x = (i % size + step % 3 - 1 + size) % size;
          const int y = (i / size + step / 3 - 1 + size) % size;
          smooth[i] += noise[static_cast<size_t>(y) * size + x] / 3.0;
        }
      }
      noise.swap(smooth);
    }
    for (size_t i = 0; i < count; ++i) {
      squares[i] += noise[i] * noise[i];
    }
  }
  SeamGraph graph{.size = size, .right = std::vector<int>(count), .down = std::vector<int>(count)};
  const auto cost = [&](size_t p, size_t q) {
    return std::min(GridCut::kMaxCapacitySum / 2,
                    static_cast<int>(kScale * (std::sqrt(squares[p]) + std::sqrt(squares[q]))));
  };
  for (size_t i = 0; i < count; ++i) {
    if (static_cast<int>(i % size) + 1 < size) {
      graph.right[i] = cost(i, i + 1);
    }
    if (i + size < count) {
      graph.down[i] = cost(i, i + size);
    }
  }
  return graph;
}

template <typename Cut>
void SetEdges(const SeamGraph& graph, Cut& cut) {
  const int n = graph.size;
  for (int y = 0; y < n; ++y) {
    for (int x = 0; x < n; ++x) {
      const int i = y * n + x;
      if (x + 1 < n) {
        cut.SetEdge(x, y, GridCut::kRight, graph.right[i], graph.right[i]);
      }
      if (y + 1 < n) {
        cut.SetEdge(x, y, GridCut::kDown, graph.down[i], graph.down[i]);
      }
    }
  }
}

int64_t SolveWithGridCut(const SeamGraph& graph, GridCut& cut) {
  const int n = graph.size;
  cut.Reset(n, n);
  SetEdges(graph, cut);
  for (int y = 0; y < n; ++y) {
    cut.AddTerminals(0, y, GridCut::kPinned, 0);
    cut.AddTerminals(n - 1, y, 0, GridCut::kPinned);
  }
  return cut.Solve();
}

int64_t SolveWithBorderCut(const SeamGraph& graph, BorderCut& cut) {
  const int n = graph.size;
  cut.Reset(n, n);
  SetEdges(graph, cut);
  cut.SetTerminals({{0, n - 1}, {0, 0}}, {{n - 1, 0}, {n - 1, n - 1}});
  return cut.Solve();
}

int64_t SolveWithBoost(const SeamGraph& graph) {
  using Graph =
      boost::compressed_sparse_row_graph<boost::directedS, boost::no_property, boost::no_property, int, int>;
  const int n = graph.size;
  const int count = n * n;
  const int source = count;
  const int sink = count + 1;
  // Arcs by tail: right, up, left, down, terminal; then those of source and sink. arc[v][d] is the arc's
  // number.
  std::vector<std::pair<int, int>> arcs;
  std::vector<float> capacity;
  std::vector<std::array<int, 5>> arc(count);
  arcs.reserve(static_cast<size_t>(4) * count + 4 * n);
  capacity.reserve(arcs.capacity());
  const auto add = [&](int tail, int head, int arc_capacity) {
    arcs.emplace_back(tail, head);
    capacity.push_back(static_cast<float>(arc_capacity));
    return static_cast<int>(arcs.size()) - 1;
  };
  for (int y = 0; y < n; ++y) {
    for (int x = 0; x < n; ++x) {
      const int i = y * n + x;
      arc[i][0] = x + 1 < n ? add(i, i + 1, graph.right[i]) : -1;
      arc[i][1] = y > 0 ? add(i, i - n, graph.down[i - n]) : -1;
      arc[i][2] = x > 0 ? add(i, i - 1, graph.right[i - 1]) : -1;
      arc[i][3] = y + 1 < n ? add(i, i + n, graph.down[i]) : -1;
      arc[i][4] = x == 0 ? add(i, source, 0) : x + 1 == n ? add(i, sink, GridCut::kPinned) : -1;
    }
  }
  std::vector<int> reverse_arc(arcs.size() + 2 * n);
  for (int y = 0; y < n; ++y) {
    reverse_arc[arc[y * n][4]] = add(source, y * n, GridCut::kPinned);
    reverse_arc[arcs.size() - 1] = arc[y * n][4];
  }
  for (int y = 0; y < n; ++y) {
    reverse_arc[arc[y * n + n - 1][4]] = add(sink, y * n + n - 1, 0);
    reverse_arc[arcs.size() - 1] = arc[y * n + n - 1][4];
  }
  const std::array<int, 4> step = {1, -n, -1, n};
  for (int i = 0; i < count; ++i) {
    for (int d = 0; d < 4; ++d) {
      if (arc[i][d] >= 0) {
        reverse_arc[arc[i][d]] = arc[i + step[d]][d ^ 2];
      }
    }
  }
  Graph boost_graph(boost::edges_are_sorted, arcs.begin(), arcs.end(), count + 2);
  using Edge = boost::graph_traits<Graph>::edge_descriptor;
  std::vector<Edge> reverse_edge(arcs.size());
  for (size_t e = 0; e < arcs.size(); ++e) {
    reverse_edge[e] = Edge(arcs[reverse_arc[e]].first, reverse_arc[e]);
  }
  std::vector<float> residual(arcs.size());
  std::vector<Edge> predecessor(count + 2);
  std::vector<boost::default_color_type> colour(count + 2);
  std::vector<int> distance(count + 2);
  const auto edge_index = get(boost::edge_index, boost_graph);
  const auto vertex_index = get(boost::vertex_index, boost_graph);
  const float flow = boost::boykov_kolmogorov_max_flow(
      boost_graph, boost::make_iterator_property_map(capacity.begin(), edge_index),
      boost::make_iterator_property_map(residual.begin(), edge_index),
      boost::make_iterator_property_map(reverse_edge.begin(), edge_index),
      boost::make_iterator_property_map(predecessor.begin(), vertex_index),
      boost::make_iterator_property_map(colour.begin(), vertex_index),
      boost::make_iterator_property_map(distance.begin(), vertex_index), vertex_index, source, sink);
  return std::llround(flow);
}

double Median(std::vector<double> values) {
  std::nth_element(values.begin(), values.begin() + values.size() / 2, values.end());
  return values[values.size() / 2];
}

template <typename Body>
double Milliseconds(const Body& body) {
  const auto start = std::chrono::steady_clock::now();
  body();
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
}

// Prints the median of a ratio and its verdict; false when it misses a limit that applies.
bool PrintRatio(const char* name, int size, const std::vector<double>& ratios, double limit, int smallest) {
  const double ratio = Median(ratios);
  if (size < smallest) {
    std::printf("max_flow.%s.%d,%.2f,boost/ours,,\n", name, size, ratio);
    return true;
  }
  const bool passed = ratio >= limit;
  std::printf("max_flow.%s.%d,%.2f,boost/ours,>=%.1f,%s\n", name, size, ratio, limit,
              passed ? "pass" : "FAIL");
  return passed;
}

}  // namespace

int main() {
  bool passed = true;
  std::printf("name,value,unit,limit,verdict\n");
  for (const int size : {32, 64, 128, 256}) {
    std::vector<double> boost_ms, grid_ms, border_ms, grid_ratio, border_ratio;
    GridCut grid;
    BorderCut border;
    for (int round = 0; round < kRounds; ++round) {
      const SeamGraph graph = MakeSeamGraph(size, round + 1);
      int64_t boost_value = 0;
      int64_t grid_value = 0;
      int64_t border_value = 0;
      boost_ms.push_back(Milliseconds([&] { boost_value = SolveWithBoost(graph); }));
      grid_ms.push_back(Milliseconds([&] { grid_value = SolveWithGridCut(graph, grid); }));
      border_ms.push_back(Milliseconds([&] { border_value = SolveWithBorderCut(graph, border); }));
      grid_ratio.push_back(boost_ms.back() / grid_ms.back());
      border_ratio.push_back(boost_ms.back() / border_ms.back());
      if (boost_value != grid_value || boost_value != border_value) {
        std::fprintf(stderr, "size %d round %d: Boost cuts %lld, GridCut %lld, BorderCut %lld\n", size, round,
                     static_cast<long long>(boost_value), static_cast<long long>(grid_value),
                     static_cast<long long>(border_value));
        passed = false;
      }
    }
    std::printf("max_flow.boost.%d,%.3f,ms,,\n", size, Median(boost_ms));
    std::printf("max_flow.grid.%d,%.3f,ms,,\n", size, Median(grid_ms));
    std::printf("max_flow.border.%d,%.3f,ms,,\n", size, Median(border_ms));
    passed = PrintRatio("grid_ratio", size, grid_ratio, kMinGridRatio, kSmallestGrid) && passed;
    passed = PrintRatio("border_ratio", size, border_ratio, kMinBorderRatio, kSmallestBorder) && passed;
  }
  return passed ? 0 : 1;
}
