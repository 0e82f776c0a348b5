#include "btf/tiles/regularity.h"

#include <algorithm>
#include <cmath>

namespace tessera {
namespace {

constexpr double kNearlyHighest = 0.85;  // of the highest peak: counts as a period too
constexpr double kLargestDip = 0.8;      // of the highest peak: what lies between two periods is lower
constexpr double kSmallestSine = 0.5;    // of the angle between two period vectors
constexpr double kSlipShare = 1.0 / 8.0;
constexpr double kPeakShare = 1.0 / 8.0;

struct CorrelationPeak {
  PeriodVector at;
  double value = 0.0;
};

double Length(const PeriodVector& v) {
  return std::hypot(v[0], v[1]);
}

double Cross(const PeriodVector& a, const PeriodVector& b) {
  return a[0] * b[1] - a[1] * b[0];
}

PeriodVector Sum(const PeriodVector& a, double times, const PeriodVector& b) {
  return {a[0] + times * b[0], a[1] + times * b[1]};
}

bool Reaches(const Autocorrelation& autocorrelation, const PeriodVector& at, int margin) {
  return std::abs(at[0]) + margin <= autocorrelation.most_x() &&
         std::abs(at[1]) + margin <= autocorrelation.most_y();
}

// Of three values one step apart, the middle one the highest: where between them the parabola peaks.
double Vertex(double before, double middle, double after) {
  const double bend = before - 2.0 * middle + after;
  return bend < 0.0 ? std::clamp((before - after) / (2.0 * bend), -0.5, 0.5) : 0.0;
}

// The highest value within `radius` pixels of `at` along each axis, and where it peaks.
CorrelationPeak HighestNear(const Autocorrelation& autocorrelation, const PeriodVector& at, int radius) {
  const int x0 = static_cast<int>(std::lround(at[0]));
  const int y0 = static_cast<int>(std::lround(at[1]));
  int best_x = x0;
  int best_y = y0;
  for (int y = y0 - radius; y <= y0 + radius; ++y) {
    for (int x = x0 - radius; x <= x0 + radius; ++x) {
      if (autocorrelation.at(x, y) > autocorrelation.at(best_x, best_y)) {
        best_x = x;
        best_y = y;
      }
    }
  }
  const auto value = [&](int dx, int dy) { return autocorrelation.at(best_x + dx, best_y + dy); };
  return {{best_x + Vertex(value(-1, 0), value(0, 0), value(1, 0)),
           best_y + Vertex(value(0, -1), value(0, 0), value(0, 1))},
          value(0, 0)};
}

// Texels from no shift to where the autocorrelation along `direction` first falls below 0.
double EndOfFirstFeature(const Autocorrelation& autocorrelation, int dx, int dy) {
  int steps = 1;
  while (Reaches(autocorrelation, {1.0 * steps * dx, 1.0 * steps * dy}, 0) &&
         autocorrelation.at(steps * dx, steps * dy) > 0.0) {
    ++steps;
  }
  return steps * std::hypot(dx, dy);
}

// Local maxima of the upper half plane beyond the first feature, from the shortest shift on.
std::vector<CorrelationPeak> PeaksOf(const Autocorrelation& autocorrelation) {
  const double first =
      std::min({EndOfFirstFeature(autocorrelation, 1, 0), EndOfFirstFeature(autocorrelation, 0, 1),
                EndOfFirstFeature(autocorrelation, 1, 1), EndOfFirstFeature(autocorrelation, -1, 1)});
  std::vector<CorrelationPeak> peaks;
  for (int dy = 0; dy < autocorrelation.most_y(); ++dy) {
    for (int dx = 1 - autocorrelation.most_x(); dx < autocorrelation.most_x(); ++dx) {
      const double value = autocorrelation.at(dx, dy);
      if ((dy == 0 && dx <= 0) || std::hypot(dx, dy) <= first || value < kPeriodicCorrelation) {
        continue;
      }
      bool highest = true;
      for (int i = 0; i < 9; ++i) {
        highest = highest && autocorrelation.at(dx + i % 3 - 1, dy + i / 3 - 1) <= value;
      }
      if (highest) {
        peaks.push_back({{1.0 * dx, 1.0 * dy}, value});
      }
    }
  }
  std::ranges::stable_sort(
      peaks, [](const CorrelationPeak& a, const CorrelationPeak& b) { return Length(a.at) < Length(b.at); });
  return peaks;
}

// Whether the autocorrelation dips half way to `shift`: it does not where that runs along a stripe.
bool DipsOnTheWay(const Autocorrelation& autocorrelation, const PeriodVector& shift, double highest) {
  const PeriodVector half = {shift[0] / 2.0, shift[1] / 2.0};
  return !Reaches(autocorrelation, half, 1) ||
         autocorrelation.at(static_cast<int>(std::lround(half[0])), static_cast<int>(std::lround(half[1]))) <
             kLargestDip * highest;
}

// Whether `b` is more than another place along the stripes that `a` counts.
bool IsAnotherPeriod(const Autocorrelation& autocorrelation, const PeriodVector& a, const PeriodVector& b,
                     double highest) {
  constexpr int kMultiples = 3;  // either way; `a` need not stand square on the stripes
  const double nearest = std::round((a[0] * b[0] + a[1] * b[1]) / (a[0] * a[0] + a[1] * a[1]));
  for (int i = -kMultiples; i <= kMultiples; ++i) {
    if (!DipsOnTheWay(autocorrelation, Sum(b, -(nearest + i), a), highest)) {
      return false;
    }
  }
  return true;
}

// Fits the two vectors to the peaks found at their sums, from the nearest ones outwards.
void Sharpen(const Autocorrelation& autocorrelation, std::vector<PeriodVector>& vectors) {
  const int farthest = static_cast<int>(std::max(autocorrelation.most_x(), autocorrelation.most_y()) /
                                        std::max(1.0, Length(vectors[0])));
  for (int reach = 1; reach <= farthest; ++reach) {
    // Normal equations of i v0 + j v1 = peak.
    double ii = 0.0;
    double ij = 0.0;
    double jj = 0.0;
    PeriodVector ip = {};
    PeriodVector jp = {};
    for (int i = 0; i <= reach; ++i) {
      for (int j = -reach; j <= reach; ++j) {
        const PeriodVector expected = Sum({i * vectors[0][0], i * vectors[0][1]}, j, vectors[1]);
        if ((i == 0 && j <= 0) || !Reaches(autocorrelation, expected, 3)) {
          continue;
        }
        const CorrelationPeak peak = HighestNear(autocorrelation, expected, 1);
        if (peak.value < kPeriodicCorrelation) {
          continue;
        }
        ii += i * i;
        ij += i * j;
        jj += j * j;
        ip = Sum(ip, i, peak.at);
        jp = Sum(jp, j, peak.at);
      }
    }
    const double determinant = ii * jj - ij * ij;
    for (int axis = 0; axis < 2 && determinant > 0.0; ++axis) {
      vectors[0][axis] = (jj * ip[axis] - ij * jp[axis]) / determinant;
      vectors[1][axis] = (ii * jp[axis] - ij * ip[axis]) / determinant;
    }
  }
}

// The period square to stripes, from any on the first stripe: p / |p|^2 is fitted to whole numbers at the
// peaks, from the nearest ones outwards.
PeriodVector SquareToStripes(const std::vector<CorrelationPeak>& peaks, const PeriodVector& first) {
  PeriodVector wave = {first[0] / (Length(first) * Length(first)),
                       first[1] / (Length(first) * Length(first))};
  for (int reach = 2; reach <= 8; ++reach) {
    double xx = 0.0;
    double xy = 0.0;
    double yy = 0.0;
    PeriodVector wanted = {};
    for (const CorrelationPeak& peak : peaks) {
      if (Length(peak.at) <= reach * Length(first)) {
        xx += peak.at[0] * peak.at[0];
        xy += peak.at[0] * peak.at[1];
        yy += peak.at[1] * peak.at[1];
        wanted = Sum(wanted, std::round(wave[0] * peak.at[0] + wave[1] * peak.at[1]), peak.at);
      }
    }
    const double determinant = xx * yy - xy * xy;
    if (determinant > 0.0) {
      wave = {(yy * wanted[0] - xy * wanted[1]) / determinant,
              (xx * wanted[1] - xy * wanted[0]) / determinant};
    }
  }
  const double square = wave[0] * wave[0] + wave[1] * wave[1];
  return square > 0.0 ? PeriodVector{wave[0] / square, wave[1] / square} : first;
}

// Distance of a shift from the nearest sum of whole periods.
double SlipOf(const Period& period, const PeriodVector& shift) {
  const PeriodVector& a = period.vectors[0];
  if (period.vectors.size() == 1) {
    const double times = (shift[0] * a[0] + shift[1] * a[1]) / (a[0] * a[0] + a[1] * a[1]);
    return std::abs(times - std::round(times)) * Length(a);
  }
  const PeriodVector& b = period.vectors[1];
  const double i = std::floor(Cross(shift, b) / Cross(a, b));
  const double j = std::floor(Cross(a, shift) / Cross(a, b));
  double least = Length(shift);
  for (int corner = 0; corner < 4; ++corner) {
    const PeriodVector whole = Sum({(i + corner % 2) * a[0], (i + corner % 2) * a[1]}, j + corner / 2, b);
    least = std::min(least, Length(Sum(shift, -1.0, whole)));
  }
  return least;
}

}  // namespace

std::optional<Period> FindPeriod(const Autocorrelation& autocorrelation) {
  const std::vector<CorrelationPeak> peaks = PeaksOf(autocorrelation);
  double highest = 0.0;
  for (const CorrelationPeak& peak : peaks) {
    highest = std::max(highest, peak.value);
  }
  Period period;
  for (const CorrelationPeak& peak : peaks) {
    if (peak.value < kNearlyHighest * highest || !DipsOnTheWay(autocorrelation, peak.at, highest)) {
      continue;
    }
    if (period.vectors.empty()) {
      period.vectors.push_back(peak.at);
      continue;
    }
    const PeriodVector& first = period.vectors[0];
    if (std::abs(Cross(first, peak.at)) >= kSmallestSine * Length(first) * Length(peak.at) &&
        IsAnotherPeriod(autocorrelation, first, peak.at, highest)) {
      period.vectors.push_back(peak.at);
      break;
    }
  }
  if (period.vectors.empty()) {
    return std::nullopt;
  }
  if (period.vectors.size() == 1) {
    period.vectors[0] = SquareToStripes(peaks, period.vectors[0]);
  } else {
    Sharpen(autocorrelation, period.vectors);
  }
  return period;
}

double PeriodSlip(const Period& period, int tile_size) {
  return std::max(SlipOf(period, {1.0 * tile_size, 0.0}), SlipOf(period, {0.0, 1.0 * tile_size}));
}

double LargestSlip(const Period& period) {
  return kSlipShare * Length(period.vectors[0]);
}

std::optional<int> TileSizeInStep(const Period& period, int tile_size, int least, int most) {
  std::optional<int> nearest;
  for (int size = least; size <= most; ++size) {
    const double slip = PeriodSlip(period, size);
    if (slip > LargestSlip(period) || slip > PeriodSlip(period, size - 1) ||
        slip > PeriodSlip(period, size + 1)) {
      continue;
    }
    const int distance = std::abs(size - tile_size);
    const int nearest_distance = nearest ? std::abs(*nearest - tile_size) : distance + 1;
    if (distance < nearest_distance ||
        (distance == nearest_distance && slip < PeriodSlip(period, *nearest))) {
      nearest = size;
    }
  }
  return nearest;
}

double CorrelationInStep(const Autocorrelation& autocorrelation, const Period& period, double distance,
                         int shrink) {
  const int radius =
      std::max(1, static_cast<int>(std::lround(kPeakShare * Length(period.vectors[0]) / shrink)));
  double sum = 0.0;
  for (const PeriodVector& vector : period.vectors) {
    double times = std::ceil(distance / Length(vector));
    const auto place = [&] { return PeriodVector{times * vector[0] / shrink, times * vector[1] / shrink}; };
    while (times > 1.0 && !Reaches(autocorrelation, place(), radius + 2)) {
      times -= 1.0;
    }
    sum += Reaches(autocorrelation, place(), radius + 2) ? HighestNear(autocorrelation, place(), radius).value
                                                         : 0.0;
  }
  return sum / static_cast<double>(period.vectors.size());
}

}  // namespace tessera
