#include "btf/light/environment.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <absl/strings/str_cat.h>

#include "btf/base/status_macros.h"
#include "btf/image/byte_stream.h"
#include "btf/image/image_io.h"
#include "btf/image/image_reader.h"
#include "btf/math/conventions.h"

namespace tessera {
namespace {

absl::Status CheckEnvironmentSize(const std::string& name, int64_t width, int64_t height) {
  return width * height <= kMaxEnvironmentTexels
             ? absl::OkStatus()
             : absl::InvalidArgumentError(absl::StrCat(name, ": environment of ", width, "x", height,
                                                       " texels, at most ", kMaxEnvironmentTexels));
}

absl::StatusOr<EnvironmentLayout> LayoutOf(const Image& image, const std::string& name,
                                           const EnvironmentOptions& options) {
  if (options.layout == EnvironmentLayout::kAngular && image.width != image.height) {
    return absl::InvalidArgumentError(
        absl::StrCat(name, ": ", image.width, "x", image.height, " texels, an angular map is square"));
  }
  if (options.layout.has_value()) {
    return *options.layout;
  }
  if (image.width == 2 * image.height) {
    return EnvironmentLayout::kEquirect;
  }
  if (image.width == image.height) {
    return EnvironmentLayout::kAngular;
  }
  return absl::InvalidArgumentError(
      absl::StrCat(name, ": ", image.width, "x", image.height,
                   " texels, expected 2:1 (equirectangular) or 1:1 (angular map)"));
}

absl::Status CheckOptions(const std::string& name, const EnvironmentOptions& options) {
  if (!std::isfinite(options.rotation_rad)) {
    return absl::InvalidArgumentError(
        absl::StrCat(name, ": environment's rotation is ", options.rotation_rad));
  }
  if (!std::isfinite(options.scale) || options.scale <= 0.0) {
    return absl::InvalidArgumentError(
        absl::StrCat(name, ": environment's scale is ", options.scale, ", expected above 0"));
  }
  return absl::OkStatus();
}

// Three channels; 0 where the grid has nothing.
absl::StatusOr<Image> CheckedTexels(const Image& image, const TexelGrid& grid, const std::string& name) {
  constexpr std::array<const char*, 3> kChannelNames = {"red", "green", "blue"};
  Image rgb(image.width, image.height, 3);
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      if (grid.SolidAngle(x, y) == 0.0) {
        continue;
      }
      for (int channel = 0; channel < 3; ++channel) {
        const float value = image.at(x, y)[image.channels == 1 ? 0 : channel];
        if (!std::isfinite(value) || value < 0.0F) {
          return absl::InvalidArgumentError(absl::StrCat(name, ": ", kChannelNames[channel], " of texel (", x,
                                                         ", ", y, ") is ", value,
                                                         ", expected radiance, finite and not below 0"));
        }
        rgb.at(x, y)[channel] = value;
      }
    }
  }
  return rgb;
}

}  // namespace

absl::StatusOr<Environment> Environment::Create(const Image& image, std::string_view name,
                                                const EnvironmentOptions& options) {
  const std::string owned_name(name);
  const auto num_samples =
      static_cast<size_t>(std::max(image.width, 0)) * std::max(image.height, 0) * std::max(image.channels, 0);
  if (num_samples == 0 || image.channels == 2 || image.channels > 4 || image.pixels.size() != num_samples) {
    return absl::InvalidArgumentError(absl::StrCat(owned_name, ": environment of ", image.width, "x",
                                                   image.height, " texels, ", image.channels, " channels, ",
                                                   image.pixels.size(), " samples"));
  }
  TESSERA_RETURN_IF_ERROR(CheckEnvironmentSize(owned_name, image.width, image.height));
  TESSERA_RETURN_IF_ERROR(CheckOptions(owned_name, options));
  TESSERA_ASSIGN_OR_RETURN(const EnvironmentLayout layout, LayoutOf(image, owned_name, options));
  TexelGrid grid(layout, image.width, image.height);
  TESSERA_ASSIGN_OR_RETURN(Image rgb, CheckedTexels(image, grid, owned_name));
  return Environment(std::move(grid), std::move(rgb), options);
}

Environment::Environment(TexelGrid grid, Image image, const EnvironmentOptions& options)
    : grid_(std::move(grid)),
      image_(std::move(image)),
      rotation_rad_(options.rotation_rad),
      scale_(options.scale) {
  const double cosine = std::cos(rotation_rad_);
  const double sine = std::sin(rotation_rad_);
  world_from_picture_ << cosine, 0.0, sine, 0.0, 1.0, 0.0, -sine, 0.0, cosine;
  power_.setZero();
  for (int y = 0; y < image_.height; ++y) {
    Eigen::Array3d row = Eigen::Array3d::Zero();
    for (int x = 0; x < image_.width; ++x) {
      row += TexelRadiance(x, y) * grid_.SolidAngle(x, y);
    }
    power_ += row;
  }
}

Eigen::Array3d Environment::MeanRadiance() const {
  return power_ / (4.0 * kPi);
}

Eigen::Array3d Environment::Radiance(const Eigen::Vector3d& direction) const {
  const Eigen::Vector3d in_picture = world_from_picture_.transpose() * direction;
  Eigen::Vector2d place = grid_.Place(in_picture) - Eigen::Vector2d(0.5, 0.5);
  const int width = image_.width;
  const int height = image_.height;
  Eigen::Array3d sum = Eigen::Array3d::Zero();
  if (grid_.layout() == EnvironmentLayout::kEquirect) {
    // Beyond a pole lies the same row, half a turn on.
    const auto along_row = [&](int y) -> Eigen::Array3d {
      const bool is_beyond = y < 0 || y >= height;
      const double x = place.x() + (is_beyond ? 0.5 * width : 0.0);
      const double x_floor = std::floor(x);
      const int left = (static_cast<int>(x_floor) % width + width) % width;
      const int row = std::clamp(y, 0, height - 1);
      return (1.0 - (x - x_floor)) * TexelRadiance(left, row) +
             (x - x_floor) * TexelRadiance((left + 1) % width, row);
    };
    const double y_floor = std::floor(place.y());
    const double below = place.y() - y_floor;
    return (1.0 - below) * along_row(static_cast<int>(y_floor)) +
           below * along_row(static_cast<int>(y_floor) + 1);
  }
  // Half a texel within the rim, so that the texel it lies in has some part within.
  const Eigen::Vector2d centre(0.5 * (width - 1), 0.5 * (height - 1));
  const double radius = (place - centre).norm();
  if (radius > centre.x()) {
    place = centre + (place - centre) * (centre.x() / radius);
  }
  const Eigen::Vector2d floor = place.array().floor();
  double weights = 0.0;
  for (int corner = 0; corner < 4; ++corner) {
    const int x = static_cast<int>(floor.x()) + corner % 2;
    const int y = static_cast<int>(floor.y()) + corner / 2;
    if (x < 0 || x >= width || y < 0 || y >= height || grid_.SolidAngle(x, y) == 0.0) {
      continue;
    }
    const double weight = (1.0 - std::abs(place.x() - x)) * (1.0 - std::abs(place.y() - y));
    sum += weight * TexelRadiance(x, y);
    weights += weight;
  }
  return sum / weights;
}

Environment Reduced(const Environment& environment, int height) {
  const TexelGrid coarse(EnvironmentLayout::kEquirect, 2 * height, height);
  const TexelGrid& fine = environment.grid();
  std::vector<Eigen::Array4d> sums(static_cast<size_t>(coarse.width()) * height, Eigen::Array4d::Zero());
  for (int y = 0; y < fine.height(); ++y) {
    for (int x = 0; x < fine.width(); ++x) {
      const Eigen::Vector2d place = coarse.Place(fine.Direction(x, y));
      const int column = std::min(static_cast<int>(place.x()), coarse.width() - 1);
      const int row = std::min(static_cast<int>(place.y()), height - 1);
      const double solid_angle = fine.SolidAngle(x, y);
      Eigen::Array4d& sum = sums[static_cast<size_t>(row) * coarse.width() + column];
      sum.head<3>() += solid_angle * environment.TexelRadiance(x, y);
      sum[3] += solid_angle;
    }
  }
  Image image(coarse.width(), height, 3);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < coarse.width(); ++x) {
      const Eigen::Array4d& sum = sums[static_cast<size_t>(y) * coarse.width() + x];
      const Eigen::Array3d radiance =
          sum[3] > 0.0 ? Eigen::Array3d(sum.head<3>() / sum[3])
                       : environment.Radiance(environment.world_from_picture() * coarse.Direction(x, y));
      for (int channel = 0; channel < 3; ++channel) {
        image.at(x, y)[channel] = static_cast<float>(radiance[channel] / environment.scale());
      }
    }
  }
  // What is finite and not negative stays so.
  return *Environment::Create(image, "reduced",
                              {.layout = EnvironmentLayout::kEquirect,
                               .rotation_rad = environment.rotation_rad(),
                               .scale = environment.scale()});
}

absl::StatusOr<Environment> ReadEnvironment(const std::filesystem::path& path,
                                            const EnvironmentOptions& options) {
  TESSERA_ASSIGN_OR_RETURN(std::unique_ptr<ByteStream> stream, OpenFileStream(path));
  TESSERA_ASSIGN_OR_RETURN(const std::unique_ptr<ImageReader> reader,
                           OpenImage(std::move(stream), path.string(), {}));
  TESSERA_RETURN_IF_ERROR(
      CheckEnvironmentSize(path.string(), reader->header().width, reader->header().height));
  TESSERA_ASSIGN_OR_RETURN(const Image image, ReadImage(path, std::nullopt));
  return Environment::Create(image, path.string(), options);
}

absl::StatusOr<Environment> DecodeEnvironment(std::span<const std::byte> bytes, std::string_view name,
                                              const EnvironmentOptions& options) {
  TESSERA_ASSIGN_OR_RETURN(const std::unique_ptr<ImageReader> reader,
                           OpenImage(MakeMemoryStream(bytes), name, {}));
  TESSERA_RETURN_IF_ERROR(
      CheckEnvironmentSize(std::string(name), reader->header().width, reader->header().height));
  TESSERA_ASSIGN_OR_RETURN(const Image image, DecodeImage(bytes, name, std::nullopt));
  return Environment::Create(image, name, options);
}

}  // namespace tessera
