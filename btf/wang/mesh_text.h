// Text of mesh files: lines, words, numbers; and what both formats are parsed into.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <Eigen/Core>

#include "btf/wang/quad_mesh.h"

namespace tessera {

// A mesh as its file has it: nothing is checked but numbers, counts and corners a face.
struct RawMesh {
  std::vector<Eigen::Vector3f> positions;
  std::vector<Eigen::Vector3f> normals;  // as listed, any length
  std::vector<Quad> quads;
  std::vector<std::array<int32_t, 4>> corner_normals;  // into `normals`, -1: none; as many as quads, or empty
};

// Lines with '#' comments taken off, '\' continuations joined and blank ones passed over, split into words.
class LineReader {
 public:
  explicit LineReader(std::string_view text) : text_(text) {}

  // False at the end. The words live as long as the reader and until the next call.
  [[nodiscard]] bool Next();
  [[nodiscard]] const std::vector<std::string_view>& words() const { return words_; }
  // Number of the line, from 1; of the first one where lines were joined.
  [[nodiscard]] size_t line() const { return line_; }

 private:
  std::string_view text_;
  size_t next_line_ = 1;
  size_t line_ = 0;
  std::string joined_;
  std::vector<std::string_view> words_;
};

// "line 12: MESSAGE".
[[nodiscard]] absl::Status LineError(const LineReader& reader, std::string_view message);

// Three finite float32 numbers, words [first, first + 3). Errors: INVALID_ARGUMENT naming line and word.
[[nodiscard]] absl::StatusOr<Eigen::Vector3f> ParseVector(const LineReader& reader, size_t first);

// A whole number. Errors: INVALID_ARGUMENT naming line and word.
[[nodiscard]] absl::StatusOr<int64_t> ParseWhole(const LineReader& reader, std::string_view word);

// Counts faces that are not quads, and remembers the first.
class FaceTally {
 public:
  // True when the face has four corners.
  bool Add(size_t corners, size_t line);
  // OK when all faces were quads; INVALID_ARGUMENT naming the first other and how many there are.
  [[nodiscard]] absl::Status Check() const;

 private:
  size_t faces_ = 0;
  size_t others_ = 0;
  size_t first_face_ = 0;
  size_t first_corners_ = 0;
  size_t first_line_ = 0;
};

[[nodiscard]] absl::StatusOr<RawMesh> ParseObj(std::string_view text);
[[nodiscard]] absl::StatusOr<RawMesh> ParseOff(std::string_view text);

}  // namespace tessera
