#include "btf/codec/container.h"

#include <algorithm>
#include <utility>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>

#include "btf/codec/container_layout.h"

namespace tessera {

std::string_view DTypeName(DType dtype) {
  return std::ranges::find(kDTypeNames, dtype, &std::pair<DType, std::string_view>::first)->second;
}

size_t DTypeSize(DType dtype) {
  switch (dtype) {
    case DType::kU8:
      return 1;
    case DType::kU16:
      return 2;
    case DType::kU32:
    case DType::kF32:
      return 4;
    case DType::kF64:
      return 8;
  }
  return 0;
}

const Section* Container::Find(std::string_view name) const {
  const auto it = std::ranges::find(sections, name, &Section::name);
  return it == sections.end() ? nullptr : &*it;
}

absl::StatusOr<const Section*> RequireSection(const Container& container, std::string_view name, DType dtype,
                                              std::span<const int64_t> shape) {
  const Section* section = container.Find(name);
  if (section == nullptr) {
    return InvalidSection(name, absl::StrCat("missing from a container of kind '", container.kind, "'"));
  }
  bool fits = section->dtype == dtype && section->shape.size() == shape.size();
  for (size_t i = 0; fits && i < shape.size(); ++i) {
    fits = shape[i] == -1 || section->shape[i] == shape[i];
  }
  if (!fits) {
    std::string expected;
    for (const int64_t extent : shape) {
      absl::StrAppend(&expected, expected.empty() ? "" : ", ", extent == -1 ? "n" : absl::StrCat(extent));
    }
    return InvalidSection(
        name, absl::StrCat(std::string(DTypeName(section->dtype)), " [", absl::StrJoin(section->shape, ", "),
                           "], expected ", std::string(DTypeName(dtype)), " [", expected, "]"));
  }
  return section;
}

absl::Status RequireKind(const Container& container, std::string_view kind) {
  return container.kind == kind
             ? absl::OkStatus()
             : absl::InvalidArgumentError(absl::StrCat("container kind '", container.kind, "', expected '",
                                                       absl::string_view(kind.data(), kind.size()), "'"));
}

absl::StatusOr<std::string> HeaderString(const nlohmann::json& header, std::string_view key) {
  const auto it = header.find(std::string(key));
  if (it == header.end()) {
    return std::string();
  }
  if (!it->is_string()) {
    return absl::InvalidArgumentError(absl::StrCat("header: ", std::string(key), " is not a string"));
  }
  return it->get<std::string>();
}

}  // namespace tessera
