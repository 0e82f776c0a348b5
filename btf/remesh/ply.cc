#include <bit>
#include <charconv>
#include <cmath>
#include <cstring>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include <absl/strings/str_cat.h>

#include "btf/base/status_macros.h"
#include "btf/remesh/binary_formats.h"

namespace tessera {
namespace {

static_assert(std::endian::native == std::endian::little, "binary PLY is read as it lies in memory");

constexpr std::string_view kPlyBlanks = " \t\r\n\v\f";
constexpr size_t kMaxHeaderBytes = size_t{1} << 16;
constexpr int64_t kMaxCorners = 1024;  // of one face

enum class PlyType { kInt8, kUint8, kInt16, kUint16, kInt32, kUint32, kFloat32, kFloat64 };

std::optional<PlyType> TypeNamed(std::string_view name) {
  constexpr std::array<std::string_view, 8> kShort{"char", "uchar", "short", "ushort",
                                                   "int",  "uint",  "float", "double"};
  constexpr std::array<std::string_view, 8> kLong{"int8",  "uint8",  "int16",   "uint16",
                                                  "int32", "uint32", "float32", "float64"};
  for (size_t i = 0; i < kShort.size(); ++i) {
    if (name == kShort[i] || name == kLong[i]) {
      return static_cast<PlyType>(i);
    }
  }
  return std::nullopt;
}

struct PlyProperty {
  std::string name;
  PlyType type = PlyType::kFloat32;
  std::optional<PlyType> count_type;  // of lists
};

struct PlyElement {
  std::string name;
  uint64_t count = 0;
  std::vector<PlyProperty> properties;
};

struct PlyHeader {
  bool is_ascii = false;
  std::vector<PlyElement> elements;
};

// Numbers of the body, one after the other.
class PlyBody {
 public:
  PlyBody(std::string_view bytes, bool is_ascii) : bytes_(bytes), is_ascii_(is_ascii) {}

  // The next number. Errors: INVALID_ARGUMENT: the file ends, or this is no number.
  [[nodiscard]] absl::StatusOr<double> Next(PlyType type) {
    if (is_ascii_) {
      return NextWord();
    }
    switch (type) {
      case PlyType::kInt8:
        return Take<int8_t>();
      case PlyType::kUint8:
        return Take<uint8_t>();
      case PlyType::kInt16:
        return Take<int16_t>();
      case PlyType::kUint16:
        return Take<uint16_t>();
      case PlyType::kInt32:
        return Take<int32_t>();
      case PlyType::kUint32:
        return Take<uint32_t>();
      case PlyType::kFloat32:
        return Take<float>();
      case PlyType::kFloat64:
        return Take<double>();
    }
    return absl::InternalError("unknown type");
  }

 private:
  template <typename T>
  absl::StatusOr<double> Take() {
    if (bytes_.size() < sizeof(T)) {
      return absl::InvalidArgumentError("the file is cut off here");
    }
    T value{};
    std::memcpy(&value, bytes_.data(), sizeof(T));
    bytes_.remove_prefix(sizeof(T));
    return static_cast<double>(value);
  }

  absl::StatusOr<double> NextWord() {
    bytes_.remove_prefix(std::min(bytes_.find_first_not_of(kPlyBlanks), bytes_.size()));
    const std::string_view word = bytes_.substr(0, bytes_.find_first_of(kPlyBlanks));
    bytes_.remove_prefix(word.size());
    if (word.empty()) {
      return absl::InvalidArgumentError("the file is cut off here");
    }
    double value = 0.0;
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
    if (error != std::errc() || end != word.data() + word.size()) {
      return absl::InvalidArgumentError("a word is not a number");
    }
    return value;
  }

  std::string_view bytes_;
  bool is_ascii_;
};

// The words of one line of the header.
std::vector<std::string_view> WordsOf(std::string_view line) {
  std::vector<std::string_view> words;
  for (size_t begin = line.find_first_not_of(kPlyBlanks); begin != std::string_view::npos;
       begin = line.find_first_not_of(kPlyBlanks, begin)) {
    const size_t end = std::min(line.find_first_of(kPlyBlanks, begin), line.size());
    words.push_back(line.substr(begin, end - begin));
    begin = end;
  }
  return words;
}

absl::Status AddLine(const std::vector<std::string_view>& words, PlyHeader& header, bool& has_format) {
  if (words.empty() || words[0] == "comment" || words[0] == "obj_info") {
    return absl::OkStatus();
  }
  if (words[0] == "format" && words.size() >= 2) {
    if (words[1] != "ascii" && words[1] != "binary_little_endian") {
      return absl::InvalidArgumentError("the format is neither ascii nor binary_little_endian");
    }
    header.is_ascii = words[1] == "ascii";
    has_format = true;
    return absl::OkStatus();
  }
  if (words[0] == "element" && words.size() == 3) {
    PlyElement element{.name = std::string(words[1])};
    const auto [end, error] =
        std::from_chars(words[2].data(), words[2].data() + words[2].size(), element.count);
    if (error != std::errc() || end != words[2].data() + words[2].size()) {
      return absl::InvalidArgumentError("the count of the element is not a whole number");
    }
    const size_t limit = element.name == "vertex" ? kMaxMeshVertices
                         : element.name == "face" ? kMaxMeshTriangles
                                                  : std::numeric_limits<size_t>::max();
    if (element.count > limit) {
      return absl::ResourceExhaustedError(
          absl::StrCat(element.count, " elements '", element.name, "'; the limit is ", limit));
    }
    header.elements.push_back(std::move(element));
    return absl::OkStatus();
  }
  if (words[0] == "property" && !header.elements.empty()) {
    const bool is_list = words.size() == 5 && words[1] == "list";
    if (is_list || words.size() == 3) {
      const std::optional<PlyType> type = TypeNamed(words[words.size() - 2]);
      PlyProperty property{.name = std::string(words.back())};
      if (is_list) {
        property.count_type = TypeNamed(words[2]);
      }
      if (type && (!is_list || property.count_type)) {
        property.type = *type;
        header.elements.back().properties.push_back(std::move(property));
        return absl::OkStatus();
      }
    }
  }
  return absl::InvalidArgumentError("not a statement of PLY");
}

// Takes the header off `bytes`.
absl::StatusOr<PlyHeader> TakeHeader(std::string_view& bytes) {
  PlyHeader header;
  bool has_format = false;
  const std::string_view start = bytes.substr(0, kMaxHeaderBytes);
  size_t at = 0;
  for (size_t line = 1;; ++line) {
    const size_t end = start.find('\n', at);
    if (end == std::string_view::npos) {
      return absl::InvalidArgumentError(
          absl::StrCat("the header does not end within ", start.size(), " bytes"));
    }
    const std::vector<std::string_view> words = WordsOf(start.substr(at, end - at));
    at = end + 1;
    if (line == 1) {
      if (words.size() != 1 || words[0] != "ply") {
        return absl::InvalidArgumentError("the file does not start with ply");
      }
    } else if (words.size() == 1 && words[0] == "end_header") {
      break;
    } else if (const absl::Status status = AddLine(words, header, has_format); !status.ok()) {
      return absl::Status(
          status.code(),
          absl::StrCat("line ", line, ": ", std::string(status.message().data(), status.message().size())));
    }
  }
  if (!has_format) {
    return absl::InvalidArgumentError("the header names no format");
  }
  bytes.remove_prefix(at);
  return header;
}

// What reading one element found.
struct PlyValues {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  std::vector<double> corners;
};

absl::Status ReadElement(const PlyElement& element, PlyBody& body, PlyValues& values) {
  values.corners.clear();
  for (const PlyProperty& property : element.properties) {
    if (!property.count_type) {
      TESSERA_ASSIGN_OR_RETURN(const double value, body.Next(property.type));
      if (property.name.size() == 1 && property.name[0] >= 'x' && property.name[0] <= 'z') {
        values.position[property.name[0] - 'x'] = value;
      }
      continue;
    }
    TESSERA_ASSIGN_OR_RETURN(const double count, body.Next(*property.count_type));
    if (!(count >= 0.0 && count <= std::numeric_limits<uint32_t>::max() && count == std::floor(count))) {
      return absl::InvalidArgumentError(absl::StrCat("a list of ", count, " numbers"));
    }
    const bool is_face = property.name == "vertex_indices" || property.name == "vertex_index";
    if (is_face && count > static_cast<double>(kMaxCorners)) {
      return absl::ResourceExhaustedError(absl::StrCat(count, " corners; the limit is ", kMaxCorners));
    }
    for (double i = 0; i < count; ++i) {
      TESSERA_ASSIGN_OR_RETURN(const double value, body.Next(property.type));
      if (is_face) {
        values.corners.push_back(value);
      }
    }
  }
  return absl::OkStatus();
}

absl::Status AddVertex(const PlyValues& values, TriangleMesh& mesh) {
  mesh.positions.emplace_back(values.position.cast<float>());
  return mesh.positions.back().allFinite() ? absl::OkStatus()
                                           : absl::InvalidArgumentError("the position is not finite");
}

absl::Status AddFace(const PlyValues& values, uint64_t num_vertices, TriangleMesh& mesh,
                     TriangleReadNotes& notes) {
  if (values.corners.size() < 3) {
    return absl::InvalidArgumentError(
        absl::StrCat(values.corners.size(), " corners, expected three or more"));
  }
  for (const double corner : values.corners) {
    if (!(corner >= 0.0 && corner < static_cast<double>(num_vertices) && corner == std::floor(corner))) {
      return absl::InvalidArgumentError(
          absl::StrCat("it names vertex ", corner, ", which does not exist; the mesh has ", num_vertices));
    }
  }
  if (mesh.triangles.size() + values.corners.size() - 2 > kMaxMeshTriangles) {
    return absl::ResourceExhaustedError(absl::StrCat("more than ", kMaxMeshTriangles, " triangles"));
  }
  for (size_t k = 2; k < values.corners.size(); ++k) {
    mesh.triangles.push_back({static_cast<uint32_t>(values.corners[0]),
                              static_cast<uint32_t>(values.corners[k - 1]),
                              static_cast<uint32_t>(values.corners[k])});
  }
  notes.faces_fanned += values.corners.size() > 3;
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<TriangleMesh> ParsePly(std::string_view bytes, TriangleReadNotes& notes) {
  TESSERA_ASSIGN_OR_RETURN(const PlyHeader header, TakeHeader(bytes));
  uint64_t num_vertices = 0;
  for (const PlyElement& element : header.elements) {
    num_vertices += element.name == "vertex" ? element.count : 0;
  }
  TriangleMesh mesh;
  PlyBody body(bytes, header.is_ascii);
  PlyValues values;
  for (const PlyElement& element : header.elements) {
    // Elements without properties take no bytes, whatever their number.
    for (uint64_t i = 0; i < element.count && !element.properties.empty(); ++i) {
      absl::Status status = ReadElement(element, body, values);
      if (status.ok() && element.name == "vertex") {
        status = AddVertex(values, mesh);
      } else if (status.ok() && element.name == "face") {
        status = AddFace(values, num_vertices, mesh, notes);
      }
      if (!status.ok()) {
        return absl::Status(status.code(),
                            absl::StrCat(element.name, " ", i + 1, " of ", element.count, ": ",
                                         std::string(status.message().data(), status.message().size())));
      }
    }
  }
  return mesh;
}

}  // namespace tessera
