// Text of mesh files: lines, words, numbers; and what OBJ and OFF are parsed into.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <Eigen/Core>

#include "btf/wang/quad_mesh.h"

namespace tessera {

// Which faces are kept: quads, for dressing, or everything with three corners or more, for remeshing.
enum class FaceKind { kQuads, kPolygons };

// Counts faces that are not of the kind, and remembers the first.
class FaceTally {
 public:
  explicit FaceTally(FaceKind kind = FaceKind::kQuads) : kind_(kind) {}

  // True when the face is of the kind.
  bool Add(size_t corners, size_t line);
  [[nodiscard]] size_t others() const { return others_; }
  // OK when all faces were of the kind; INVALID_ARGUMENT naming the first other and how many there are.
  [[nodiscard]] absl::Status Check() const;

 private:
  FaceKind kind_;
  size_t faces_ = 0;
  size_t others_ = 0;
  size_t first_face_ = 0;
  size_t first_corners_ = 0;
  size_t first_line_ = 0;
};

// A mesh as its file has it: nothing is checked but numbers and counts. Faces that are not of the kind asked
// for are left out; `tally` has their number and the error.
struct RawMesh {
  std::vector<Eigen::Vector3f> positions;
  std::vector<Eigen::Vector3f> normals;  // as listed, any length
  std::vector<Quad> quads;
  std::vector<std::array<int32_t, 4>> corner_normals;  // into `normals`, -1: none; as many as quads, or empty
  // With kPolygons instead of quads: n-gons as fans about their first corner.
  std::vector<std::array<uint32_t, 3>> triangles;
  size_t faces_fanned = 0;  // of more than three corners
  FaceTally tally;

  // Adds the fan of a face of three corners or more.
  void AddFan(std::span<const uint32_t> corners);
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

// Errors: INVALID_ARGUMENT naming the line, RESOURCE_EXHAUSTED naming the count and the limit.
[[nodiscard]] absl::StatusOr<RawMesh> ParseObj(std::string_view text, FaceKind kind);
[[nodiscard]] absl::StatusOr<RawMesh> ParseOff(std::string_view text, FaceKind kind);

}  // namespace tessera
