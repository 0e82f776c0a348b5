// Words in a picture: fixed-width letters of 5 x 8 dots.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "btf/image/image.h"

namespace tessera::cli {

// Dots from one letter, or line, to the next.
inline constexpr int kLetterPitch = 6;
inline constexpr int kLinePitch = 10;

// `text` in lines of at most `most_letters` >= 1, broken at spaces, `-` and `/` where there are any.
[[nodiscard]] std::vector<std::string> BrokenLines(std::string_view text, int most_letters);

// Black dots of `scale` x `scale` pixels, the first letter's upper left corner at (x, y); what lies outside
// the picture is left out, what is not printable ASCII is shown as `?`.
void DrawLine(std::string_view line, int x, int y, int scale, Image& picture);

}  // namespace tessera::cli
