#include "btf/light/frequency_light.h"

#include <array>
#include <cassert>
#include <cmath>
#include <utility>
#include <vector>

#include <absl/strings/str_cat.h>

#include "btf/base/status_macros.h"
#include "btf/light/sh_rotation.h"
#include "btf/math/conventions.h"
#include "btf/math/hemisphere_gram.h"
#include "btf/math/spherical_harmonics.h"

namespace tessera {
namespace {

// Integrals over columns, [W][2 degree + 1]: of cos(m a) in column degree + m, of sin(m a) in degree - m.
Eigen::MatrixXd ColumnIntegrals(int width, int degree) {
  Eigen::MatrixXd integrals(width, 2 * degree + 1);
  for (int x = 0; x < width; ++x) {
    const double azimuth = 2.0 * kPi * ((x + 0.5) / width - 0.5);
    integrals(x, degree) = 2.0 * kPi / width;
    for (int m = 1; m <= degree; ++m) {
      const double of_width = 2.0 / m * std::sin(m * kPi / width);
      integrals(x, degree + m) = of_width * std::cos(m * azimuth);
      integrals(x, degree - m) = of_width * std::sin(m * azimuth);
    }
  }
  return integrals;
}

// Integrals over row `y` of Y(l, |m|) at azimuth 0 times the sine of the polar angle, which for the polar
// axis +y runs from pi y / height.
Eigen::VectorXd RowIntegrals(int y, int height, int n, const GaussLegendreRule& rule) {
  Eigen::VectorXd integrals = Eigen::VectorXd::Zero(n);
  Eigen::VectorXd harmonics(n);
  for (Eigen::Index i = 0; i < rule.nodes.size(); ++i) {
    const double theta = kPi * (y + rule.nodes[i]) / height;
    EvaluateSh({std::sin(theta), 0.0, std::cos(theta)}, std::span(harmonics.data(), static_cast<size_t>(n)));
    integrals += rule.weights[i] * kPi / height * std::sin(theta) * harmonics;
  }
  for (int l = 1; l * l < n; ++l) {
    for (int m = 1; m <= l; ++m) {
      integrals[l * (l + 1) - m] = integrals[l * (l + 1) + m];
    }
  }
  return integrals;
}

// In harmonics of directions (x, y, z) = (-z, -x, y) of the picture, where the azimuth is that of
// texel_grid.h, the other way round, and the polar axis is up.
Eigen::MatrixXd ProjectEquirect(const Environment& environment, int n) {
  constexpr int kNodes = 24;  // a row may be half a circle, of which degree 7 makes seven half-waves
  const int width = environment.grid().width();
  const int height = environment.grid().height();
  const int degree = ShDegree(n);
  const GaussLegendreRule rule = GaussLegendre(kNodes);
  const Eigen::MatrixXd columns = ColumnIntegrals(width, degree);
  Eigen::MatrixXd coefficients = Eigen::MatrixXd::Zero(n, 3);
  Eigen::MatrixXd radiance(width, 3);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      radiance.row(x) = environment.TexelRadiance(x, y).matrix().transpose();
    }
    const Eigen::MatrixXd by_azimuth = columns.transpose() * radiance;
    const Eigen::VectorXd by_elevation = RowIntegrals(y, height, n, rule);
    for (int l = 0; l <= degree; ++l) {
      for (int m = -l; m <= l; ++m) {
        const double sign = m < 0 ? -1.0 : 1.0;  // of the sine, the azimuth being the other way round
        coefficients.row(l * (l + 1) + m) +=
            sign * by_elevation[l * (l + 1) + m] * by_azimuth.row(degree + m);
      }
    }
  }
  return coefficients;
}

// The harmonics' integral over one of the cells that the picture is cut into: their mean over four Gauss
// points, which count as the solid angle is dense there, sin(pi r) / r, times the cell's solid angle.
Eigen::VectorXd CellHarmonics(const TexelGrid& cells, int x, int y, int n) {
  const double offset = 0.5 / std::sqrt(3.0);
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(n);
  Eigen::VectorXd harmonics(n);
  double weights = 0.0;
  const auto add = [&](double column, double row, double weight) {
    EvaluateSh(cells.DirectionAt(column, row), std::span(harmonics.data(), static_cast<size_t>(n)));
    sum += weight * harmonics;
    weights += weight;
  };
  for (int corner = 0; corner < 4; ++corner) {
    const double column = x + 0.5 + (corner % 2 == 0 ? -offset : offset);
    const double row = y + 0.5 + (corner / 2 == 0 ? -offset : offset);
    const double r = std::hypot(2.0 * column / cells.width() - 1.0, 2.0 * row / cells.height() - 1.0);
    if (r < 1.0) {
      add(column, row, r == 0.0 ? kPi : std::sin(kPi * r) / r);
    }
  }
  if (weights == 0.0) {
    add(x + 0.5, y + 0.5, 1.0);  // at the rim, where all is one direction
  }
  return cells.SolidAngle(x, y) / weights * sum;
}

// In harmonics of the picture's directions.
Eigen::MatrixXd ProjectAngular(const Environment& environment, int n) {
  constexpr int kMinCells = 256;  // 1.4 degrees: degree 6 turns by 0.15 radians within
  const int width = environment.grid().width();
  const int cuts = (kMinCells + width - 1) / width;
  const TexelGrid cells(EnvironmentLayout::kAngular, width * cuts, width * cuts);
  Eigen::MatrixXd coefficients = Eigen::MatrixXd::Zero(n, 3);
  for (int y = 0; y < cells.height(); ++y) {
    for (int x = 0; x < cells.width(); ++x) {
      if (cells.SolidAngle(x, y) > 0.0) {
        coefficients += CellHarmonics(cells, x, y, n) *
                        environment.TexelRadiance(x / cuts, y / cuts).matrix().transpose();
      }
    }
  }
  return coefficients;
}

void Window(Eigen::MatrixXd& coefficients) {
  const int degree = ShDegree(static_cast<int>(coefficients.rows()));
  for (int l = 1; l <= degree; ++l) {
    const double x = kPi * l / (degree + 1);
    coefficients.middleRows(l * l, 2 * l + 1) *= std::sin(x) / x;
  }
}

}  // namespace

absl::StatusOr<Eigen::MatrixXd> ProjectEnvironment(const Environment& environment, int n, ShWindow window) {
  if (!IsShFunctionCount(n)) {
    return absl::InvalidArgumentError(
        absl::StrCat(n, " harmonics of the environment, expected 1, 4, 9, 16, 25, 36 or 49"));
  }
  const bool is_equirect = environment.grid().layout() == EnvironmentLayout::kEquirect;
  Eigen::Matrix3d picture_from_harmonics = Eigen::Matrix3d::Identity();
  if (is_equirect) {
    picture_from_harmonics << 0, -1, 0, 0, 0, 1, -1, 0, 0;
  }
  Eigen::MatrixXd coefficients =
      ShRotation(environment.world_from_picture() * picture_from_harmonics, ShDegree(n))
          .Apply(is_equirect ? ProjectEquirect(environment, n) : ProjectAngular(environment, n));
  if (window == ShWindow::kLanczos) {
    Window(coefficients);
  }
  return coefficients;
}

absl::StatusOr<FrequencyLight> FrequencyLight::Create(const Environment& environment, int n,
                                                      ShWindow window) {
  TESSERA_ASSIGN_OR_RETURN(Eigen::MatrixXd coefficients, ProjectEnvironment(environment, n, window));
  return FrequencyLight(std::move(coefficients));
}

FrequencyLight::FrequencyLight(Eigen::MatrixXd coefficients) : coefficients_(std::move(coefficients)) {
  assert(coefficients_.cols() == 3 && IsShFunctionCount(num_functions()));
}

Eigen::MatrixXd FrequencyLight::InFrame(const Eigen::Matrix3d& local_from_world) const {
  return ShRotation(local_from_world, ShDegree(num_functions())).Apply(coefficients_);
}

LinearForm RadianceForm(const Decoder& decoder, const Eigen::Vector3d& view, const Eigen::MatrixXd& light,
                        int turns) {
  const int n = static_cast<int>(light.rows());
  // The light by the BTFel's own directions u = UnturnedFromTurned(w): what is there at w, so turned back.
  const ShQuarterTurns back = MakeShQuarterTurns(4 - (turns & 3));
  const std::vector<LinearForm> forms = decoder.LightHarmonics(n, UnturnedFromTurned(view, turns));
  LinearForm sum;
  sum.runs = forms[0].runs;
  sum.weights.assign(forms[0].weights.size(), 0.0);
  for (int i = 0; i < n; ++i) {
    const Eigen::RowVector3d rgb = back.sign[i] / kPi * light.row(back.source[i]);
    size_t index = 0;
    for (const LinearForm::Run& run : sum.runs) {
      for (int end = static_cast<int>(index) + run.count; std::cmp_less(index, end); ++index) {
        sum.weights[index] += rgb[run.channel] * forms[i].weights[index];
      }
    }
  }
  return sum;
}

}  // namespace tessera
