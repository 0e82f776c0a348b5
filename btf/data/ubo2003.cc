#include <charconv>
#include <utility>

#include <absl/strings/str_cat.h>

#include "btf/base/status_macros.h"
#include "btf/data/error_list.h"
#include "btf/data/layouts.h"

namespace tessera {

namespace {

// Reads a name from the left; every step fails for good once one has failed.
class NameParser {
 public:
  explicit NameParser(std::string_view text) : rest_(text) {}

  NameParser& Literal(std::string_view text) {
    ok_ = ok_ && rest_.starts_with(text);
    rest_.remove_prefix(ok_ ? text.size() : 0);
    return *this;
  }
  // 1 to 9 decimal digits.
  NameParser& Number(double& value) {
    size_t digits = 0;
    while (digits < rest_.size() && digits < 10 && rest_[digits] >= '0' && rest_[digits] <= '9') {
      ++digits;
    }
    int number = 0;
    ok_ = ok_ && digits >= 1 && digits <= 9;
    if (ok_) {
      std::from_chars(rest_.data(), rest_.data() + digits, number);
      rest_.remove_prefix(digits);
    }
    value = number;
    return *this;
  }
  [[nodiscard]] bool AtEnd() const { return ok_ && rest_.empty(); }
  [[nodiscard]] bool ok() const { return ok_; }

 private:
  std::string_view rest_;
  bool ok_ = true;
};

// "NNNNN tlTTT plPPP tvTTT pvPPP" and an ending.
bool ParseImageName(std::string_view base, AnglesDeg& light, AnglesDeg& view) {
  double number = 0.0;
  return NameParser(base)
      .Number(number)
      .Literal(" tl")
      .Number(light.polar_deg)
      .Literal(" pl")
      .Number(light.azimuth_deg)
      .Literal(" tv")
      .Number(view.polar_deg)
      .Literal(" pv")
      .Number(view.azimuth_deg)
      .Literal(".")
      .ok();
}

bool ParseFolderName(std::string_view folder, AnglesDeg& view) {
  return NameParser(folder)
      .Literal("tv")
      .Number(view.polar_deg)
      .Literal("_pv")
      .Number(view.azimuth_deg)
      .AtEnd();
}

struct SplitName {
  std::string_view folder;  // innermost, without those above
  std::string_view base;
};

SplitName Split(std::string_view name) {
  const size_t slash = name.rfind('/');
  if (slash == std::string_view::npos) {
    return {{}, name};
  }
  const std::string_view folders = name.substr(0, slash);
  const size_t above = folders.rfind('/');
  return {above == std::string_view::npos ? folders : folders.substr(above + 1), name.substr(slash + 1)};
}

}  // namespace

bool LooksLikeUbo2003(const FileSet& files) {
  for (const FileEntry& file : files.files()) {
    AnglesDeg light;
    AnglesDeg view;
    const SplitName split = Split(file.name);
    if (HasImageName(file.name) &&
        (ParseFolderName(split.folder, view) || ParseImageName(split.base, light, view))) {
      return true;
    }
  }
  return false;
}

absl::StatusOr<ImageList> ListUbo2003(std::shared_ptr<const FileSet> files) {
  ImageList list;
  std::vector<size_t> indices;
  ErrorList faults;
  for (size_t i = 0; i < files->files().size(); ++i) {
    const std::string& name = files->files()[i].name;
    if (!HasImageName(name)) {
      continue;
    }
    const SplitName split = Split(name);
    SampleAngles sample{name, {}, {}};
    AnglesDeg folder_view;
    const bool in_view_folder = ParseFolderName(split.folder, folder_view);
    if (!ParseImageName(split.base, sample.light, sample.view)) {
      if (in_view_folder) {
        faults.Add(absl::StrCat("'", name, "' is not named NNNNN tlTTT plPPP tvTTT pvPPP"));
      }
      continue;  // a picture of something else, outside the measured folders
    }
    if (in_view_folder && (folder_view.polar_deg != sample.view.polar_deg ||
                           folder_view.azimuth_deg != sample.view.azimuth_deg)) {
      faults.Add(absl::StrCat("'", name, "' disagrees with its folder's view"));
    }
    list.samples.push_back(std::move(sample));
    indices.push_back(i);
  }
  if (!faults.empty()) {
    return absl::InvalidArgumentError(absl::StrCat(faults.count(), " images are misnamed: ", faults.Text()));
  }
  if (list.samples.empty()) {
    return absl::InvalidArgumentError(
        absl::StrCat("none of ", files->files().size(),
                     " files is an image named like UBO2003: tvTTT_pvPPP/NNNNN tlTTT plPPP tvTTT pvPPP.jpg"));
  }
  list.images = MakeFileImages(std::move(files), std::move(indices));
  return list;
}

}  // namespace tessera
