#include "client/cli/describe.h"

#include <algorithm>

#include <fmt/format.h>
#include <google/protobuf/util/time_util.h>

#include "client/lib/names.h"

namespace tessera::cli {
namespace {

// Numbers of a certificate or of metadata are measurements: five digits tell all they know.
constexpr char kNumberFormat[] = "{:.5g}";
// Longer arrays are counted in text; --json has them whole.
constexpr size_t kLongestListInText = 16;

Json Embedded(const std::string& text) {
  if (text.empty()) {
    return Json::object();
  }
  Json value = Json::parse(text, nullptr, /*allow_exceptions=*/false);
  return value.is_discarded() ? Json(text) : value;
}

Json Describe(const v1::Blob& blob) {
  return {{"sha256", blob.sha256()}, {"size_bytes", blob.size_bytes()}};
}

Json Describe(const v1::Provenance& provenance) {
  return {{"source", provenance.source()},
          {"licence", provenance.licence()},
          {"citation", provenance.citation()}};
}

Json Describe(const google::protobuf::Timestamp& time) {
  return time.seconds() == 0 ? Json("") : Json(google::protobuf::util::TimeUtil::ToString(time));
}

std::string TextOf(const Json& value) {
  if (value.is_string()) {
    return value.get<std::string>();
  }
  if (value.is_number_float()) {
    return fmt::format(kNumberFormat, value.get<double>());
  }
  if (value.is_array()) {
    if (value.size() > kLongestListInText) {
      return fmt::format("({} values)", value.size());
    }
    std::string list;
    for (const Json& element : value) {
      list += fmt::format("{}{}", list.empty() ? "" : " ", TextOf(element));
    }
    return list;
  }
  return value.is_null() ? "" : value.dump();
}

// What was written for people, a line each.
bool IsListOfSentences(const Json& value) {
  return value.is_array() && std::ranges::all_of(value, [](const Json& element) {
           return element.is_string() && element.get_ref<const std::string&>().find(' ') != std::string::npos;
         });
}

void AppendRecord(const Json& object, const std::string& prefix,
                  std::vector<std::pair<std::string, std::string>>& lines) {
  for (const auto& [key, value] : object.items()) {
    const std::string name = prefix.empty() ? key : fmt::format("{}.{}", prefix, key);
    if (value.is_object()) {
      AppendRecord(value, name, lines);
    } else if (value.is_array() && !value.empty() && value.front().is_object()) {
      for (size_t i = 0; i < value.size(); ++i) {
        lines.emplace_back(fmt::format("{}.{}", name, i), value[i].dump());
      }
    } else if (IsListOfSentences(value)) {
      for (const Json& sentence : value) {
        lines.emplace_back(name, sentence.get<std::string>());
      }
    } else if (std::string text = TextOf(value); !text.empty()) {
      lines.emplace_back(name, std::move(text));
    }
  }
}

}  // namespace

Json Describe(const v1::Material& material) {
  return {{"name", ShortName(material.name())},
          {"width", material.width()},
          {"height", material.height()},
          {"codec", material.codec()},
          {"num_coefficients", material.num_coefficients()},
          {"num_views", material.num_views()},
          {"num_lights", material.num_lights()},
          {"radiometry", material.radiometry()},
          {"provenance", Describe(material.provenance())},
          {"blob", Describe(material.blob())},
          {"create_time", Describe(material.create_time())},
          {"metadata", Embedded(material.metadata_json())}};
}

Json Describe(const v1::Arrangement& arrangement) {
  Json codes = Json::array();
  for (const uint32_t code : arrangement.tile_codes()) {
    codes.push_back(code);
  }
  return {{"name", ShortName(arrangement.name())},    {"num_tiles", arrangement.tile_codes_size()},
          {"num_colours", arrangement.num_colours()}, {"turned_strips", arrangement.turned_strips()},
          {"sha256", arrangement.sha256()},           {"tile_codes", std::move(codes)}};
}

Json Describe(const v1::TileSet& tile_set) {
  return {{"name", ShortName(tile_set.name())},
          {"tile_size", tile_set.tile_size()},
          {"strip_height", tile_set.strip_height()},
          {"num_tiles", tile_set.num_tiles()},
          {"num_btfels", tile_set.num_btfels()},
          {"codec", tile_set.codec()},
          {"arrangement_sha256", tile_set.arrangement_sha256()},
          {"provenance", Describe(tile_set.provenance())},
          {"blob", Describe(tile_set.blob())},
          {"thumbnail", tile_set.has_thumbnail() ? Describe(tile_set.thumbnail()) : Json()},
          {"create_time", Describe(tile_set.create_time())},
          {"certificate", Embedded(tile_set.certificate_json())},
          {"metadata", Embedded(tile_set.metadata_json())}};
}

Json Describe(const v1::Job& job) {
  Json value = {{"name", ShortName(job.name())},
                {"kind", job.kind()},
                {"state", StateName(job.state())},
                {"attempt", job.attempt()},
                {"result_name", ShortName(job.result_name())},
                {"progress",
                 {{"stage", job.progress().stage()},
                  {"done", job.progress().done()},
                  {"total", job.progress().total()},
                  {"unit", job.progress().unit()}}},
                {"create_time", Describe(job.create_time())},
                {"start_time", Describe(job.start_time())},
                {"end_time", Describe(job.end_time())}};
  if (job.state() == v1::Job::FAILED) {
    value["error"] = {{"code", job.error().code()},
                      {"reason", job.error().detail().reason()},
                      {"subject", job.error().detail().subject()},
                      {"message", job.error().message()}};
  }
  return value;
}

Json Describe(const v1::ServerStatus& status) {
  return {{"version", status.version()},
          {"num_workers", status.num_workers()},
          {"num_queued_jobs", status.num_queued_jobs()},
          {"num_running_jobs", status.num_running_jobs()},
          {"num_materials", status.num_materials()},
          {"num_tile_sets", status.num_tile_sets()},
          {"blob_bytes", status.blob_bytes()},
          {"uptime_s", status.uptime_s()}};
}

std::string StateName(v1::Job::State state) {
  return v1::Job::State_Name(state);
}

std::string JobLine(const v1::Job& job) {
  std::string line = fmt::format("{} {} {}", ShortName(job.name()), job.kind(), StateName(job.state()));
  const v1::JobProgress& progress = job.progress();
  if (job.state() == v1::Job::RUNNING && !progress.stage().empty()) {
    line += fmt::format(" {} {}", progress.stage(), progress.done());
    line += progress.total() > 0 ? fmt::format("/{} {}", progress.total(), progress.unit())
                                 : fmt::format(" {}", progress.unit());
  }
  if (job.state() == v1::Job::SUCCEEDED) {
    line += fmt::format(" {}", ShortName(job.result_name()));
  }
  if (job.state() == v1::Job::FAILED) {
    line += fmt::format(": {}", job.error().message());
  }
  return line;
}

std::string TextTable(const std::vector<std::vector<std::string>>& rows) {
  std::vector<size_t> widths;
  for (const auto& row : rows) {
    widths.resize(std::max(widths.size(), row.size()));
    for (size_t i = 0; i < row.size(); ++i) {
      widths[i] = std::max(widths[i], row[i].size());
    }
  }
  std::string text;
  for (const auto& row : rows) {
    std::string line;
    for (size_t i = 0; i < row.size(); ++i) {
      line += i + 1 == row.size() ? row[i] : fmt::format("{:<{}}  ", row[i], widths[i]);
    }
    text += fmt::format("{}{}", text.empty() ? "" : "\n", line);
  }
  return text;
}

std::string TextRecord(const Json& object) {
  std::vector<std::pair<std::string, std::string>> lines;
  AppendRecord(object, "", lines);
  size_t width = 0;
  for (const auto& line : lines) {
    width = std::max(width, line.first.size());
  }
  std::string text;
  for (const auto& [name, value] : lines) {
    text += fmt::format("{}{:<{}}  {}", text.empty() ? "" : "\n", fmt::format("{}:", name), width + 1, value);
  }
  return text;
}

}  // namespace tessera::cli
