// Transfer curves: how code values of image files relate to linear light. The only place that knows them.
//
//   TESSERA_ASSIGN_OR_RETURN(Transfer transfer, ParseTransfer("gamma:2.2"));
//   double linear = LinearFromEncoded(transfer, code / 255.0);
//
// Source: IEC 61966-2-1 (sRGB), section 4.5.
#pragma once

#include <string>
#include <string_view>

#include <absl/status/statusor.h>

namespace tessera {

enum class TransferKind { kSrgb, kLinear, kGamma };

struct Transfer {
  TransferKind kind = TransferKind::kSrgb;
  double gamma = 2.2;  // of kGamma only: linear = encoded^gamma, 0.1..10

  static Transfer Srgb() { return {TransferKind::kSrgb, 2.2}; }
  static Transfer Linear() { return {TransferKind::kLinear, 1.0}; }

  friend bool operator==(const Transfer& a, const Transfer& b) {
    return a.kind == b.kind && (a.kind != TransferKind::kGamma || a.gamma == b.gamma);
  }
};

// "srgb", "linear" or "gamma:G" with G in [0.1, 10]. Errors: INVALID_ARGUMENT naming the text and the legal
// forms.
[[nodiscard]] absl::StatusOr<Transfer> ParseTransfer(std::string_view text);
// The text that ParseTransfer reads back.
[[nodiscard]] std::string TransferName(const Transfer& transfer);

// The sRGB curve and its inverse, both odd (f(-x) = -f(x)) and continued above 1 by the same formula, so that
// values out of [0, 1] survive a round trip.
[[nodiscard]] double LinearFromSrgb(double encoded);
[[nodiscard]] double SrgbFromLinear(double linear);

// Encoded values in units of full scale (code 255 of 8 bits is 1). Odd, as above.
[[nodiscard]] double LinearFromEncoded(const Transfer& transfer, double encoded);
[[nodiscard]] double EncodedFromLinear(const Transfer& transfer, double linear);

}  // namespace tessera
