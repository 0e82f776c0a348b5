#include "btf/chart/codec_chart.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <memory>
#include <numeric>
#include <span>
#include <utility>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include "btf/base/cpu_time.h"
#include "btf/base/parallel.h"
#include "btf/base/status_macros.h"
#include "btf/chart/jpeg_peer.h"
#include "btf/chart/pictures.h"
#include "btf/codec/decoder.h"
#include "btf/data/memory_btf.h"
#include "btf/data/subset_btf.h"

namespace tessera {
namespace {

constexpr int kMeasuredRows = 32;  // at most about as many rows of texels are compared for all pairs
constexpr int kPicturesPerClass = 16;
constexpr int kQuickMeasuredRows = 8;
constexpr int kQuickPicturesPerClass = 8;
constexpr int kCropSide = 128;

// What one split is measured on.
struct SplitData {
  Split split = Split::kSampled;
  PairSet pairs;
  std::array<int64_t, kNumAngleLimits> population{};
  std::vector<PicturePair> chosen;
  std::vector<Image> references;  // of `chosen`
};

// The pair of a view and a light nearest to the angles wanted; `lights` and `views` are what may be chosen.
PicturePair NearestPair(const BtfInfo& info, const PairSet& pairs, const Direction& view,
                        const Direction& light) {
  const auto nearest = [](const std::vector<Direction>& directions, const std::vector<int>& among,
                          const Direction& wanted) {
    return *std::ranges::max_element(among, {}, [&](int i) {
      return VectorFromDirection(directions[i]).dot(VectorFromDirection(wanted));
    });
  };
  PicturePair pair;
  pair.view = nearest(info.views, pairs.views, view);
  pair.light = nearest(info.lights, pairs.lights, light);
  pair.angle_class = AngleClass(info.views[pair.view], info.lights[pair.light]);
  return pair;
}

std::string DirectionText(const Direction& d) {
  return absl::StrFormat("(%.0f°, %.0f°)", DegFromRad(d.theta_rad), DegFromRad(d.phi_rad));
}

Image MiddleOf(const Image& image) {
  const int width = std::min(image.width, kCropSide);
  const int height = std::min(image.height, kCropSide);
  Image crop(width, height, 3);
  for (int y = 0; y < height; ++y) {
    std::copy_n(image.at((image.width - width) / 2, (image.height - height) / 2 + y), width * 3,
                crop.at(0, y));
  }
  return crop;
}

class ChartRun {
 public:
  ChartRun(BtfSource& source, OffscreenContext& gl, const RunContext& context, SourceChart& chart)
      : source_(source), gl_(gl), context_(context), quiet_(context), chart_(chart) {
    quiet_.progress = nullptr;
  }

  absl::Status Run() {
    TESSERA_RETURN_IF_ERROR(Prepare());
    const std::vector<ChartSetting> settings = ChartSettings(chart_.size);
    const std::vector<int> qualities = ChartJpegQualities(chart_.size);
    // A step is an encoding with its measurement. JPEG has one a quality, its copy of the images and the two
    // found by bisection.
    num_steps_ = settings.size() * splits_.size() + qualities.size() + 3;
    for (const ChartSetting& setting : settings) {
      TESSERA_RETURN_IF_ERROR(AddCodecPoint(setting));
    }
    if (std::ranges::none_of(chart_.points, [](const ChartPoint& point) { return point.refusal.empty(); })) {
      return absl::InvalidArgumentError(
          absl::StrCat(chart_.name, ": every codec refuses it: ", chart_.points[0].refusal));
    }
    Step();
    TESSERA_ASSIGN_OR_RETURN(const JpegPeer jpeg, JpegPeer::Create(source_, chart_.row_stride, quiet_));
    for (const int quality : qualities) {
      TESSERA_RETURN_IF_ERROR(AddJpegPoint(jpeg, quality, ""));
    }
    return AddGroups(jpeg);
  }

 private:
  void Step() { context_.Report("chart", steps_done_++, num_steps_, "steps"); }

  absl::Status Prepare() {
    const BtfInfo& info = source_.info();
    std::vector<PicturePair> wanted;
    for (const Split split : kSplits) {
      if (!SplitExists(info, split)) {
        continue;
      }
      SplitData data{.split = split, .pairs = MeasuredPairs(info, split)};
      data.population = PairsByClass(info, data.pairs);
      data.chosen = ChoosePictures(info, data.pairs, chart_.pictures_per_class);
      wanted.insert(wanted.end(), data.chosen.begin(), data.chosen.end());
      splits_.push_back(std::move(data));
    }
    for (const SplitData& data : splits_) {
      AddCrops(data, wanted);
    }
    TESSERA_ASSIGN_OR_RETURN(std::vector<Image> pictures, ReadPictures(source_, wanted, quiet_));
    auto next = pictures.begin();
    for (SplitData& data : splits_) {
      data.references.assign(std::make_move_iterator(next),
                             std::make_move_iterator(next + static_cast<ptrdiff_t>(data.chosen.size())));
      next += static_cast<ptrdiff_t>(data.chosen.size());
    }
    for (ChartCrop& crop : chart_.crops) {
      crop.reference = MiddleOf(*next++);
    }
    return absl::OkStatus();
  }

  // One pair near the middle of the angles, and of the sampled ones a grazing one.
  void AddCrops(const SplitData& data, std::vector<PicturePair>& wanted) {
    const BtfInfo& info = source_.info();
    const Direction view{RadFromDeg(30.0), RadFromDeg(0.0)};
    const Direction light{RadFromDeg(45.0), RadFromDeg(120.0)};
    std::vector<std::pair<Direction, Direction>> angles = {{view, light}};
    if (data.split == Split::kSampled) {
      angles.push_back({{RadFromDeg(70.0), RadFromDeg(30.0)}, {RadFromDeg(60.0), RadFromDeg(180.0)}});
    }
    for (const auto& [v, l] : angles) {
      const PicturePair pair = NearestPair(info, data.pairs, v, l);
      wanted.push_back(pair);
      ChartCrop crop{.split = data.split, .view = pair.view, .light = pair.light};
      crop.title = absl::StrCat(SplitName(data.split), ": view ", DirectionText(info.views[pair.view]),
                                ", light ", DirectionText(info.lights[pair.light]));
      chart_.crops.push_back(std::move(crop));
    }
  }

  // The same for codecs and for JPEG.
  absl::StatusOr<SplitFigures> Figures(const SplitData& data, const RowPredictor& row,
                                       const PicturePredictor& picture) {
    TESSERA_ASSIGN_OR_RETURN(const PairErrors errors,
                             MeasurePairs(source_, row, data.pairs, chart_.row_stride, quiet_));
    TESSERA_ASSIGN_OR_RETURN(const auto pictures,
                             ComparePictures(data.references, data.chosen, data.population, picture, quiet_));
    SplitFigures figures;
    const BtfInfo& info = source_.info();
    for (size_t i = 0; i < errors.sums.size(); ++i) {
      const Direction& view = info.views[data.pairs.views[i / data.pairs.lights.size()]];
      const Direction& light = info.lights[data.pairs.lights[i % data.pairs.lights.size()]];
      for (size_t limit = AngleClass(view, light); limit < kNumAngleLimits; ++limit) {
        figures[limit].squares.Add(errors.sums[i]);
        ++figures[limit].num_pairs;
      }
    }
    for (size_t limit = 0; limit < kNumAngleLimits; ++limit) {
      figures[limit].dssim = pictures[limit].dssim;
      figures[limit].flip = pictures[limit].flip;
      figures[limit].num_pictures = pictures[limit].num_pictures;
    }
    return figures;
  }

  absl::Status AddCodecPoint(const ChartSetting& setting) {
    ChartPoint point{.method = setting.method, .setting = setting.setting};
    point.crops.resize(chart_.crops.size());
    for (const SplitData& data : splits_) {
      Step();
      const absl::Status status = MeasureSplit(setting, data, point);
      // What a codec refuses, the chart tells.
      if (absl::IsFailedPrecondition(status) || absl::IsInvalidArgument(status)) {
        point.refusal = absl::StrCat(SplitName(data.split), ": ", status.message());
        break;
      }
      TESSERA_RETURN_IF_ERROR(status);
    }
    chart_.points.push_back(std::move(point));
    return absl::OkStatus();
  }

  absl::Status MeasureSplit(const ChartSetting& setting, const SplitData& data, ChartPoint& point) {
    const BtfInfo& info = source_.info();
    TESSERA_ASSIGN_OR_RETURN(const std::unique_ptr<SubsetBtf> part,
                             SubsetBtf::Create(source_, EncodedPart(info, data.split)));
    BtfSource& encoded = data.split == Split::kSampled ? source_ : *part;
    const auto start = std::chrono::steady_clock::now();
    const double cpu_start = ProcessCpuSeconds();
    TESSERA_ASSIGN_OR_RETURN(const Material material,
                             FindCodec(setting.codec)->Encode(encoded, setting.params, quiet_));
    if (data.split == Split::kSampled) {
      point.encode_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
      point.encode_cpu_s = ProcessCpuSeconds() - cpu_start;
      TESSERA_ASSIGN_OR_RETURN(const ContainerFile file, MaterialFile(material));
      point.size_bytes = file.size_bytes();
      TESSERA_ASSIGN_OR_RETURN(point.cpu, MeasureCpuDecode(material, context_));
      TESSERA_ASSIGN_OR_RETURN(point.gl, MeasureGlFrame(gl_, material, context_));
    }
    TESSERA_ASSIGN_OR_RETURN(const std::unique_ptr<Decoder> decoder, MakeDecoder(material.btfels));
    const size_t row_codes = static_cast<size_t>(info.width) * material.btfels.num_coefficients;
    const auto decode = [&](std::span<const uint8_t> codes, int view, int light, std::span<float> rgb) {
      decoder->DecodeTexels(codes, VectorFromDirection(info.lights[light]),
                            VectorFromDirection(info.views[view]),
                            /*turns=*/0, rgb);
    };
    TESSERA_ASSIGN_OR_RETURN(point.splits[static_cast<size_t>(data.split)],
                             Figures(
                                 data,
                                 [&](int y, int view, int light, std::span<float> rgb) {
                                   decode(std::span(material.btfels.codes).subspan(y * row_codes, row_codes),
                                          view, light, rgb);
                                 },
                                 [&](size_t index, Image& picture) {
                                   decode(material.btfels.codes, data.chosen[index].view,
                                          data.chosen[index].light, picture.pixels);
                                 }));
    for (size_t i = 0; i < chart_.crops.size(); ++i) {
      const ChartCrop& crop = chart_.crops[i];
      if (crop.split == data.split) {
        Image picture(info.width, info.height, 3);
        decode(material.btfels.codes, crop.view, crop.light, picture.pixels);
        point.crops[i] = MiddleOf(picture);
      }
    }
    return absl::OkStatus();
  }

  absl::Status AddJpegPoint(const JpegPeer& jpeg, int quality, const std::string& remark) {
    Step();
    const BtfInfo& info = source_.info();
    TESSERA_ASSIGN_OR_RETURN(const JpegSet set, jpeg.Encode(quality, quiet_));
    const double texels = static_cast<double>(info.width) * info.height;
    ChartPoint point{.method = kJpegMethod,
                     .setting = absl::StrCat("q ", quality, remark),
                     .size_bytes = set.size_bytes,
                     .encode_s = set.encode_s,
                     .encode_cpu_s = set.encode_cpu_s,
                     .cpu = {.streaming_s = set.decode_s / texels, .random_s = set.decode_s}};
    for (const SplitData& data : splits_) {
      // Pictures first, one after the other: decoding them can fail.
      std::vector<Image> pictures;
      for (const PicturePair& pair : data.chosen) {
        TESSERA_ASSIGN_OR_RETURN(Image picture, jpeg.Picture(quality, data.split, pair.view, pair.light));
        pictures.push_back(std::move(picture));
      }
      TESSERA_ASSIGN_OR_RETURN(point.splits[static_cast<size_t>(data.split)],
                               Figures(
                                   data,
                                   [&](int y, int view, int light, std::span<float> rgb) {
                                     jpeg.Row(set, data.split, y, view, light, rgb);
                                   },
                                   [&](size_t index, Image& picture) { picture = pictures[index]; }));
    }
    for (const ChartCrop& crop : chart_.crops) {
      TESSERA_ASSIGN_OR_RETURN(const Image picture, jpeg.Picture(quality, crop.split, crop.view, crop.light));
      point.crops.push_back(MiddleOf(picture));
    }
    // Where it belongs in the curve.
    auto place = chart_.points.end();
    while (place != chart_.points.begin() && std::prev(place)->method == kJpegMethod &&
           std::prev(place)->size_bytes > point.size_bytes) {
      --place;
    }
    chart_.points.insert(place, std::move(point));
    return absl::OkStatus();
  }

  // Two places to compare at equal bytes: where [Leung2007] stands, and where the smallest models do. JPEG is
  // encoded for each.
  absl::Status AddGroups(const JpegPeer& jpeg) {
    struct Anchor {
      std::string name;
      uint64_t size_bytes = 0;
    };
    std::vector<Anchor> anchors;
    for (const auto& [method, setting] : {std::pair("dsh-cls", "25x25"), std::pair("dfmf", "rank 32")}) {
      const auto found = std::ranges::find_if(chart_.points, [&](const ChartPoint& point) {
        return point.method == method && point.setting == setting && point.refusal.empty();
      });
      if (found != chart_.points.end()) {
        anchors.push_back({absl::StrCat(method, " ", setting), found->size_bytes});
      }
    }
    for (const Anchor& anchor : anchors) {
      TESSERA_ASSIGN_OR_RETURN(const int quality, jpeg.QualityFor(anchor.size_bytes, quiet_));
      const std::string setting = absl::StrCat("q ", quality);
      if (std::ranges::none_of(chart_.points, [&](const ChartPoint& point) {
            return point.method == kJpegMethod && point.setting == setting;
          })) {
        TESSERA_RETURN_IF_ERROR(AddJpegPoint(jpeg, quality, ""));
      }
    }
    for (const Anchor& anchor : anchors) {
      CropGroup group{.title = absl::StrFormat("about the bytes of %s, %.2f MB", anchor.name,
                                               static_cast<double>(anchor.size_bytes) * 1e-6)};
      for (size_t i = 0; i < chart_.points.size();) {
        // The setting of this method nearest in bytes.
        const std::string& method = chart_.points[i].method;
        size_t nearest = chart_.points.size();
        double least = std::numeric_limits<double>::infinity();
        for (; i < chart_.points.size() && chart_.points[i].method == method; ++i) {
          const ChartPoint& point = chart_.points[i];
          const double ratio = std::abs(
              std::log(static_cast<double>(point.size_bytes) / static_cast<double>(anchor.size_bytes)));
          if (point.refusal.empty() && ratio < least) {
            least = ratio;
            nearest = i;
          }
        }
        if (nearest < chart_.points.size()) {
          group.points.push_back(nearest);
        }
      }
      chart_.groups.push_back(std::move(group));
    }
    context_.Report("chart", num_steps_, num_steps_, "steps");
    return absl::OkStatus();
  }

  BtfSource& source_;
  OffscreenContext& gl_;
  const RunContext& context_;
  RunContext quiet_;
  SourceChart& chart_;
  std::vector<SplitData> splits_;
  size_t steps_done_ = 0;
  size_t num_steps_ = 0;
};

std::vector<int> Middle(int count, int most) {
  std::vector<int> indices(std::min(count, most));
  std::iota(indices.begin(), indices.end(), (count - static_cast<int>(indices.size())) / 2);
  return indices;
}

// The middle texels, in memory where they fit: they are read once an encoding and measurement.
absl::StatusOr<std::unique_ptr<BtfSource>> MiddleTexels(BtfSource& source, const RunContext& context) {
  constexpr size_t kMostBytes = size_t{1} << 30;
  const BtfInfo& whole = source.info();
  TESSERA_ASSIGN_OR_RETURN(std::unique_ptr<SubsetBtf> middle,
                           SubsetBtf::Create(source, {.columns = Middle(whole.width, kQuickSide),
                                                      .rows = Middle(whole.height, kQuickSide)}));
  const int height = middle->info().height;
  if (middle->SamplesPerRow() * height > kMostBytes / sizeof(float)) {
    return middle;
  }
  RunContext quiet = context;
  quiet.progress = nullptr;
  std::vector<float> samples(middle->SamplesPerRow() * height);
  TESSERA_RETURN_IF_ERROR(middle->ReadRows(0, height, samples, quiet));
  return MemoryBtf::Create(middle->info(), std::move(samples));
}

}  // namespace

absl::StatusOr<SourceChart> ChartCodecs(const std::string& name, BtfSource& source, ChartSize size,
                                        OffscreenContext& gl, const RunContext& context) {
  const bool is_quick = size == ChartSize::kQuick;
  std::unique_ptr<BtfSource> middle;
  BtfSource* charted = &source;
  const BtfInfo& whole = source.info();
  SourceChart chart{.name = name};
  if (is_quick && (whole.width > kQuickSide || whole.height > kQuickSide)) {
    TESSERA_ASSIGN_OR_RETURN(middle, MiddleTexels(source, context));
    charted = middle.get();
    chart.part = absl::StrCat("the middle ", charted->info().width, "x", charted->info().height, " of ",
                              whole.width, "x", whole.height, " texels");
  }
  const BtfInfo& info = charted->info();
  chart.width = info.width;
  chart.height = info.height;
  chart.views = info.views;
  chart.lights = info.lights;
  chart.radiometry = info.radiometry;
  chart.size = size;
  chart.row_stride = std::max(1, info.height / (is_quick ? kQuickMeasuredRows : kMeasuredRows));
  chart.pictures_per_class = is_quick ? kQuickPicturesPerClass : kPicturesPerClass;
  if (chart.RawBytes() > kChartSourceBytes) {
    return absl::ResourceExhaustedError(absl::StrCat(name, ": its images take ", chart.RawBytes(),
                                                     " bytes as 8-bit RGB, a chart at most ",
                                                     kChartSourceBytes));
  }
  TESSERA_RETURN_IF_ERROR(ChartRun(*charted, gl, context, chart).Run());
  return chart;
}

}  // namespace tessera
