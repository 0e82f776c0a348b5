#include "btf/tiles/segmentation.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <span>

#include <absl/strings/str_format.h>
#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "btf/base/status_macros.h"
#include "btf/tiles/max_flow.h"

namespace tessera {
namespace {

constexpr int kModelDims = 8;       // of the embedding, that colour models see
constexpr int kModelParts = 4;      // Gaussians of a model, fewer where it has few texels
constexpr int kTexelsPerPart = 24;  // at least
constexpr int kMeansRounds = 12;
constexpr int kMostRounds = 16;  // of models and cuts; a handful settles
// Added to the variances of a Gaussian, as a share of the exemplar's: few texels do not make a sharp model.
constexpr double kModelFloor = 0.01;
// And as a model of this many texels with this share of the exemplar's variance would, dimension by
// dimension.
constexpr double kPriorTexels = 24.0;
constexpr double kPriorShare = 0.25;
constexpr double kSmoothness = 50.0;  // of [Rother2004], in nats
constexpr double kCapacityPerNat = 64.0;
constexpr double kMostNats = 1000.0;  // of one texel: fits a terminal

enum class Claim : uint8_t { kFree, kFeature, kBackground };

using Points = std::vector<Eigen::VectorXd>;

// A mixture of Gaussians.
class ColourModel {
 public:
  // `variances` of the exemplar, by dimension. At least one point.
  ColourModel(const Points& points, const Eigen::VectorXd& variances) {
    const size_t most = std::max<size_t>(1, points.size() / kTexelsPerPart);
    const size_t num_parts = std::min<size_t>(kModelParts, most);
    const std::vector<size_t> part_of = Cluster(points, num_parts);
    const Eigen::Index dims = points.front().size();
    for (size_t part = 0; part < num_parts; ++part) {
      double count = 0.0;
      Eigen::VectorXd mean = Eigen::VectorXd::Zero(dims);
      for (size_t i = 0; i < points.size(); ++i) {
        if (part_of[i] == part) {
          mean += points[i];
          count += 1.0;
        }
      }
      if (count == 0.0) {
        continue;
      }
      mean /= count;
      Eigen::MatrixXd covariance = (kPriorTexels * kPriorShare * variances).asDiagonal();
      for (size_t i = 0; i < points.size(); ++i) {
        if (part_of[i] == part) {
          covariance += (points[i] - mean) * (points[i] - mean).transpose();
        }
      }
      covariance /= count + kPriorTexels;
      covariance.diagonal().array() += kModelFloor * variances.mean();
      const Eigen::LLT<Eigen::MatrixXd> factor(covariance);
      const Eigen::VectorXd diagonal = factor.matrixLLT().diagonal();
      const double log_weight =
          std::log(count / static_cast<double>(points.size())) - diagonal.array().log().sum();
      parts_.push_back({mean, factor, log_weight});
    }
  }

  // Up to a constant that depends on the dimensions alone.
  [[nodiscard]] double NegativeLogLikelihood(const Eigen::VectorXd& point) const {
    double largest = -std::numeric_limits<double>::infinity();
    std::array<double, kModelParts> logs{};
    for (size_t part = 0; part < parts_.size(); ++part) {
      const Eigen::VectorXd whitened = parts_[part].factor.matrixL().solve(point - parts_[part].mean);
      logs[part] = parts_[part].log_weight - 0.5 * whitened.squaredNorm();
      largest = std::max(largest, logs[part]);
    }
    double sum = 0.0;
    for (size_t part = 0; part < parts_.size(); ++part) {
      sum += std::exp(logs[part] - largest);
    }
    return -largest - std::log(sum);
  }

 private:
  struct Part {
    Eigen::VectorXd mean;
    Eigen::LLT<Eigen::MatrixXd> factor;
    double log_weight;
  };

  // k-means from centres that lie far from each other.
  static std::vector<size_t> Cluster(const Points& points, size_t num_parts) {
    Eigen::VectorXd mean = Eigen::VectorXd::Zero(points.front().size());
    for (const Eigen::VectorXd& point : points) {
      mean += point / static_cast<double>(points.size());
    }
    Points centres = {mean};
    while (centres.size() < num_parts) {
      size_t farthest = 0;
      double distance = -1.0;
      for (size_t i = 0; i < points.size(); ++i) {
        double nearest = std::numeric_limits<double>::infinity();
        for (const Eigen::VectorXd& centre : centres) {
          nearest = std::min(nearest, (points[i] - centre).squaredNorm());
        }
        if (nearest > distance) {
          distance = nearest;
          farthest = i;
        }
      }
      centres.push_back(points[farthest]);
    }
    std::vector<size_t> part_of(points.size(), 0);
    for (int round = 0; round < kMeansRounds; ++round) {
      std::vector<double> counts(num_parts, 0.0);
      Points sums(num_parts, Eigen::VectorXd::Zero(mean.size()));
      for (size_t i = 0; i < points.size(); ++i) {
        const auto nearest =
            std::min_element(centres.begin(), centres.end(), [&](const auto& a, const auto& b) {
              return (points[i] - a).squaredNorm() < (points[i] - b).squaredNorm();
            });
        part_of[i] = static_cast<size_t>(nearest - centres.begin());
        counts[part_of[i]] += 1.0;
        sums[part_of[i]] += points[i];
      }
      for (size_t part = 0; part < num_parts; ++part) {
        if (counts[part] > 0.0) {
          centres[part] = sums[part] / counts[part];
        }
      }
    }
    return part_of;
  }

  std::vector<Part> parts_;
};

// The exemplar as the models see it.
struct ModelView {
  int width = 0;
  int height = 0;
  Points points;              // [height][width]
  Eigen::VectorXd variances;  // by dimension
  double edge_square = 0.0;   // mean squared distance of neighbours

  [[nodiscard]] size_t Index(int x, int y) const { return static_cast<size_t>(y) * width + x; }
};

absl::StatusOr<ModelView> MakeModelView(const Embedding& embedding) {
  constexpr double kTiny = 1e-12;  // of a constant exemplar
  ModelView view{.width = embedding.width, .height = embedding.height};
  const int dims = std::min(embedding.dims, kModelDims);
  Eigen::VectorXd mean = Eigen::VectorXd::Zero(dims);
  for (int y = 0; y < view.height; ++y) {
    for (int x = 0; x < view.width; ++x) {
      view.points.push_back(Eigen::Map<const Eigen::VectorXf>(embedding.at(0, x, y), dims).cast<double>());
      if (!view.points.back().allFinite()) {
        return absl::InvalidArgumentError(
            absl::StrFormat("texel (%d, %d) of the embedding is not finite", x, y));
      }
      mean += view.points.back();
    }
  }
  const auto count = static_cast<double>(view.points.size());
  mean /= count;
  view.variances = Eigen::VectorXd::Constant(dims, kTiny);
  for (const Eigen::VectorXd& point : view.points) {
    view.variances += (point - mean).cwiseAbs2() / count;
  }
  double num_edges = 0.0;
  for (int y = 0; y < view.height; ++y) {
    for (int x = 0; x < view.width; ++x) {
      for (const auto& [other_x, other_y] : {std::array{x + 1, y}, std::array{x, y + 1}}) {
        if (other_x < view.width && other_y < view.height) {
          view.edge_square +=
              (view.points[view.Index(x, y)] - view.points[view.Index(other_x, other_y)]).squaredNorm();
          num_edges += 1.0;
        }
      }
    }
  }
  view.edge_square = std::max(kTiny, view.edge_square / std::max(1.0, num_edges));
  return view;
}

// Texels of the polyline, both ends included.
std::vector<std::array<int, 2>> Rasterize(const Stroke& stroke) {
  std::vector<std::array<int, 2>> texels = {stroke.front()};
  for (size_t i = 1; i < stroke.size(); ++i) {
    const auto [x0, y0] = stroke[i - 1];
    const auto [x1, y1] = stroke[i];
    const int steps = std::max(std::abs(x1 - x0), std::abs(y1 - y0));
    for (int step = 1; step <= steps; ++step) {
      const double share = static_cast<double>(step) / steps;
      texels.push_back({static_cast<int>(std::lround(x0 + share * (x1 - x0))),
                        static_cast<int>(std::lround(y0 + share * (y1 - y0)))});
    }
  }
  return texels;
}

absl::Status CheckGuide(const ModelView& view, const SegmentationGuide& guide) {
  if (guide.feature.empty() && !guide.rectangle) {
    return absl::InvalidArgumentError("neither a rectangle nor a stroke of the feature");
  }
  if (guide.rectangle) {
    const Window& r = *guide.rectangle;
    if (r.width < 1 || r.height < 1 || r.x < 0 || r.y < 0 || r.width > view.width - r.x ||
        r.height > view.height - r.y) {
      return absl::InvalidArgumentError(
          absl::StrFormat("rectangle %dx%d at (%d, %d): not inside the exemplar, %dx%d", r.width, r.height,
                          r.x, r.y, view.width, view.height));
    }
  }
  for (const std::vector<Stroke>* const strokes : {&guide.feature, &guide.background}) {
    for (const Stroke& stroke : *strokes) {
      if (stroke.empty()) {
        return absl::InvalidArgumentError("a stroke without points");
      }
      for (const auto& [x, y] : stroke) {
        if (x < 0 || y < 0 || x >= view.width || y >= view.height) {
          return absl::InvalidArgumentError(absl::StrFormat("point (%d, %d): not inside the exemplar, %dx%d",
                                                            x, y, view.width, view.height));
        }
      }
    }
  }
  return absl::OkStatus();
}

// What the guide says of each texel.
absl::StatusOr<std::vector<Claim>> MakeClaims(const ModelView& view, const SegmentationGuide& guide) {
  std::vector<Claim> claims(view.points.size(), Claim::kFree);
  for (const Stroke& stroke : guide.feature) {
    for (const auto& [x, y] : Rasterize(stroke)) {
      claims[view.Index(x, y)] = Claim::kFeature;
    }
  }
  for (const Stroke& stroke : guide.background) {
    for (const auto& [x, y] : Rasterize(stroke)) {
      if (claims[view.Index(x, y)] == Claim::kFeature) {
        return absl::InvalidArgumentError(
            absl::StrFormat("texel (%d, %d): strokes of the feature and of the background cross", x, y));
      }
      claims[view.Index(x, y)] = Claim::kBackground;
    }
  }
  for (int y = 0; y < view.height && guide.rectangle; ++y) {
    for (int x = 0; x < view.width; ++x) {
      const Window& r = *guide.rectangle;
      if (x >= r.x && y >= r.y && x < r.x + r.width && y < r.y + r.height) {
        continue;
      }
      if (claims[view.Index(x, y)] == Claim::kFeature) {
        return absl::InvalidArgumentError(
            absl::StrFormat("texel (%d, %d): a stroke of the feature leaves the rectangle", x, y));
      }
      claims[view.Index(x, y)] = Claim::kBackground;
    }
  }
  return claims;
}

Points PointsWhere(const ModelView& view, const std::vector<uint8_t>& mask, uint8_t value) {
  Points points;
  for (size_t i = 0; i < mask.size(); ++i) {
    if (mask[i] == value) {
      points.push_back(view.points[i]);
    }
  }
  return points;
}

// 1 where a texel that is not the feature tells what the background looks like: with a rectangle, only inside
// it and in a band around it, for farther off the material may show the same feature again.
std::vector<uint8_t> Evidence(const ModelView& view, const std::optional<Window>& rectangle) {
  if (!rectangle) {
    return std::vector<uint8_t>(view.points.size(), 1);
  }
  std::vector<uint8_t> evidence(view.points.size(), 0);
  const int band = std::max(2, std::max(rectangle->width, rectangle->height) / 8);
  const int end_x = std::min(view.width, rectangle->x + rectangle->width + band);
  const int end_y = std::min(view.height, rectangle->y + rectangle->height + band);
  for (int y = std::max(0, rectangle->y - band); y < end_y; ++y) {
    for (int x = std::max(0, rectangle->x - band); x < end_x; ++x) {
      evidence[view.Index(x, y)] = 1;
    }
  }
  return evidence;
}

// The half of all texels that lies farther from the nearest of `known`, at least one point, than the others.
// Of many points, some stand for all.
Points FarthestHalf(const ModelView& view, const Points& known) {
  constexpr size_t kMostKnown = 256;
  const size_t stride = (known.size() + kMostKnown - 1) / kMostKnown;
  std::vector<double> squares;
  for (const Eigen::VectorXd& point : view.points) {
    double nearest = std::numeric_limits<double>::infinity();
    for (size_t i = 0; i < known.size(); i += stride) {
      nearest = std::min(nearest, (point - known[i]).squaredNorm());
    }
    squares.push_back(nearest);
  }
  std::vector<double> sorted = squares;
  const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
  std::nth_element(sorted.begin(), middle, sorted.end());
  Points points;
  for (size_t i = 0; i < squares.size(); ++i) {
    if (squares[i] >= *middle) {
      points.push_back(view.points[i]);
    }
  }
  return points;
}

// One minimum cut between the two models.
std::vector<uint8_t> CutModels(const ModelView& view, const std::vector<Claim>& claims,
                               const ColourModel& feature, const ColourModel& background) {
  GridCut grid(view.width, view.height);
  const auto edge = [&](int x, int y, GridCut::Direction direction, int other_x, int other_y) {
    const double square =
        (view.points[view.Index(x, y)] - view.points[view.Index(other_x, other_y)]).squaredNorm();
    const int capacity = static_cast<int>(
        std::lround(kCapacityPerNat * kSmoothness * std::exp(-square / (2.0 * view.edge_square))));
    grid.SetEdge(x, y, direction, capacity, capacity);
  };
  for (int y = 0; y < view.height; ++y) {
    for (int x = 0; x < view.width; ++x) {
      const size_t index = view.Index(x, y);
      if (claims[index] == Claim::kFree) {
        const double nats = background.NegativeLogLikelihood(view.points[index]) -
                            feature.NegativeLogLikelihood(view.points[index]);
        const auto capacity =
            static_cast<int>(std::lround(kCapacityPerNat * std::clamp(nats, -kMostNats, kMostNats)));
        grid.AddTerminals(x, y, std::max(0, capacity), std::max(0, -capacity));
      } else {
        const bool is_feature = claims[index] == Claim::kFeature;
        grid.AddTerminals(x, y, is_feature ? GridCut::kPinned : 0, is_feature ? 0 : GridCut::kPinned);
      }
      if (x + 1 < view.width) {
        edge(x, y, GridCut::kRight, x + 1, y);
      }
      if (y + 1 < view.height) {
        edge(x, y, GridCut::kDown, x, y + 1);
      }
    }
  }
  grid.Solve();
  std::vector<uint8_t> mask(view.points.size());
  for (int y = 0; y < view.height; ++y) {
    for (int x = 0; x < view.width; ++x) {
      mask[view.Index(x, y)] = grid.OnSourceSide(x, y) ? 1 : 0;
    }
  }
  return mask;
}

// The texels of `start`'s 4-connected piece of equal values, marked in `seen`.
std::vector<size_t> PieceOf(const ModelView& view, const std::vector<uint8_t>& mask, size_t start,
                            std::vector<uint8_t>& seen) {
  std::vector<size_t> piece = {start};
  seen[start] = 1;
  for (size_t i = 0; i < piece.size(); ++i) {  // grows while it is worked through
    const int x = static_cast<int>(piece[i] % view.width);
    const int y = static_cast<int>(piece[i] / view.width);
    for (const auto& [other_x, other_y] : {std::array{x + 1, y}, {x - 1, y}, {x, y + 1}, {x, y - 1}}) {
      if (other_x < 0 || other_y < 0 || other_x >= view.width || other_y >= view.height) {
        continue;
      }
      const size_t other = view.Index(other_x, other_y);
      if (seen[other] == 0 && mask[other] == mask[start]) {
        seen[other] = 1;
        piece.push_back(other);
      }
    }
  }
  return piece;
}

// Keeps the pieces asked for and fills what they enclose.
void Tidy(const ModelView& view, const std::vector<Claim>& claims, bool has_strokes,
          std::vector<uint8_t>& mask) {
  const auto claimed = [&](const std::vector<size_t>& piece, Claim claim) {
    return std::any_of(piece.begin(), piece.end(), [&](size_t i) { return claims[i] == claim; });
  };
  std::vector<uint8_t> kept(mask.size(), 0);
  std::vector<uint8_t> seen(mask.size(), 0);
  std::vector<size_t> largest;
  for (size_t i = 0; i < mask.size(); ++i) {
    if (mask[i] == 0 || seen[i] != 0) {
      continue;
    }
    const std::vector<size_t> piece = PieceOf(view, mask, i, seen);
    if (piece.size() > largest.size()) {
      largest = piece;
    }
    if (has_strokes && claimed(piece, Claim::kFeature)) {
      for (const size_t texel : piece) {
        kept[texel] = 1;
      }
    }
  }
  if (!has_strokes) {
    for (const size_t texel : largest) {
      kept[texel] = 1;
    }
  }
  mask = kept;
  std::fill(seen.begin(), seen.end(), 0);
  for (size_t i = 0; i < kept.size(); ++i) {
    if (kept[i] != 0 || seen[i] != 0) {
      continue;
    }
    const std::vector<size_t> piece = PieceOf(view, kept, i, seen);
    const bool at_rim = std::any_of(piece.begin(), piece.end(), [&](size_t texel) {
      const int x = static_cast<int>(texel % view.width);
      const int y = static_cast<int>(texel / view.width);
      return x == 0 || y == 0 || x == view.width - 1 || y == view.height - 1;
    });
    if (!at_rim && !claimed(piece, Claim::kBackground)) {
      for (const size_t texel : piece) {
        mask[texel] = 1;
      }
    }
  }
}

}  // namespace

absl::StatusOr<std::vector<uint8_t>> SegmentFeature(const Embedding& embedding,
                                                    const SegmentationGuide& guide) {
  TESSERA_ASSIGN_OR_RETURN(const ModelView view, MakeModelView(embedding));
  TESSERA_RETURN_IF_ERROR(CheckGuide(view, guide));
  TESSERA_ASSIGN_OR_RETURN(const std::vector<Claim> claims, MakeClaims(view, guide));

  // First models: of the strokes where there are any, else of the rectangle; of what is known not to be the
  // feature, else of what looks least like it.
  const bool has_strokes = !guide.feature.empty();
  std::vector<uint8_t> first(claims.size());
  std::vector<uint8_t> rest(claims.size());
  const std::vector<uint8_t> evidence = Evidence(view, guide.rectangle);
  for (size_t i = 0; i < claims.size(); ++i) {
    first[i] = claims[i] == Claim::kFeature || (!has_strokes && claims[i] == Claim::kFree) ? 1 : 0;
    rest[i] = claims[i] == Claim::kBackground && evidence[i] != 0 ? 1 : 0;
  }
  Points in = PointsWhere(view, first, 1);
  Points out = PointsWhere(view, rest, 1);
  if (out.empty() && has_strokes) {
    out = FarthestHalf(view, in);
  }
  std::vector<uint8_t> mask = first;
  for (int round = 0; round < kMostRounds && !in.empty() && !out.empty(); ++round) {
    std::vector<uint8_t> cut =
        CutModels(view, claims, ColourModel(in, view.variances), ColourModel(out, view.variances));
    const bool settled = cut == mask && round > 0;
    mask = std::move(cut);
    if (settled) {
      break;
    }
    in = PointsWhere(view, mask, 1);
    std::transform(mask.begin(), mask.end(), evidence.begin(), rest.begin(),
                   [](uint8_t is_feature, uint8_t tells) { return is_feature == 0 ? tells : 0; });
    out = PointsWhere(view, rest, 1);
  }
  if (!in.empty() && !out.empty()) {
    Tidy(view, claims, has_strokes, mask);
  }
  const auto num_texels = std::count(mask.begin(), mask.end(), 1);
  if (num_texels == 0) {
    return absl::InvalidArgumentError(
        "no texel is the feature: it cannot be told from what surrounds it; give strokes of the feature");
  }
  if (num_texels == static_cast<std::ptrdiff_t>(mask.size())) {
    return absl::InvalidArgumentError(
        "every texel is the feature: give strokes of the background or a smaller rectangle");
  }
  return mask;
}

}  // namespace tessera
