#include "btf/image/transfer.h"

#include <charconv>
#include <cmath>

#include <absl/status/status.h>
#include <absl/strings/str_cat.h>

namespace tessera {

namespace {

constexpr double kMinGamma = 0.1;
constexpr double kMaxGamma = 10.0;

}  // namespace

absl::StatusOr<Transfer> ParseTransfer(std::string_view text) {
  if (text == "srgb") {
    return Transfer::Srgb();
  }
  if (text == "linear") {
    return Transfer::Linear();
  }
  constexpr std::string_view kPrefix = "gamma:";
  if (text.starts_with(kPrefix)) {
    const std::string_view digits = text.substr(kPrefix.size());
    double gamma = 0.0;
    const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), gamma);
    if (error == std::errc() && end == digits.data() + digits.size() && gamma >= kMinGamma &&
        gamma <= kMaxGamma) {
      return Transfer{TransferKind::kGamma, gamma};
    }
  }
  return absl::InvalidArgumentError(absl::StrCat("transfer '", absl::string_view(text.data(), text.size()),
                                                 "': expected srgb, linear or gamma:G with G in [0.1, 10]"));
}

std::string TransferName(const Transfer& transfer) {
  switch (transfer.kind) {
    case TransferKind::kSrgb:
      return "srgb";
    case TransferKind::kLinear:
      return "linear";
    case TransferKind::kGamma:
      break;
  }
  return absl::StrCat("gamma:", transfer.gamma);
}

double LinearFromSrgb(double encoded) {
  const double x = std::abs(encoded);
  const double y = x <= 0.04045 ? x / 12.92 : std::pow((x + 0.055) / 1.055, 2.4);
  return std::copysign(y, encoded);
}

double SrgbFromLinear(double linear) {
  const double x = std::abs(linear);
  const double y = x <= 0.0031308 ? 12.92 * x : 1.055 * std::pow(x, 1.0 / 2.4) - 0.055;
  return std::copysign(y, linear);
}

double LinearFromEncoded(const Transfer& transfer, double encoded) {
  switch (transfer.kind) {
    case TransferKind::kSrgb:
      return LinearFromSrgb(encoded);
    case TransferKind::kLinear:
      return encoded;
    case TransferKind::kGamma:
      break;
  }
  return std::copysign(std::pow(std::abs(encoded), transfer.gamma), encoded);
}

double EncodedFromLinear(const Transfer& transfer, double linear) {
  switch (transfer.kind) {
    case TransferKind::kSrgb:
      return SrgbFromLinear(linear);
    case TransferKind::kLinear:
      return linear;
    case TransferKind::kGamma:
      break;
  }
  return std::copysign(std::pow(std::abs(linear), 1.0 / transfer.gamma), linear);
}

}  // namespace tessera
