// What an import must refuse, by name, and that it leaves nothing behind.
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <limits>
#include <stop_token>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "btf/data/import.h"
#include "btf/image/image_io.h"
#include "tests/support/btf_files.h"
#include "tests/support/temp_folder.h"

namespace tessera {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;

std::unique_ptr<MemoryBtf> TinyBtf() {
  return AsymmetricBtf(6, 5, WholeDegreeDirections(1, 3), WholeDegreeDirections(1, 4));
}

size_t NumOpenFiles() {
  return static_cast<size_t>(std::distance(fs::directory_iterator("/proc/self/fd"), {}));
}

// Imports files that are at fault: a spill folder stays empty and no file stays open.
class ImportErrorsTest : public ::testing::Test {
 protected:
  ImportErrorsTest() { fs::create_directory(Spill()); }

  [[nodiscard]] fs::path Spill() const { return scratch_.path() / "spill"; }
  [[nodiscard]] fs::path Data() const { return scratch_.path() / "data"; }

  absl::Status Import(const fs::path& path, ImportLayout layout = ImportLayout::kAuto) {
    const size_t open_before = NumOpenFiles();
    const absl::Status status =
        ImportBtf(path, {.layout = layout, .spill_folder = Spill()}, RunContext{}).status();
    EXPECT_EQ(NumOpenFiles(), open_before);
    EXPECT_TRUE(fs::is_empty(Spill()));
    return status;
  }

  // The message of the refusal of a folder with these files.
  std::string Refusal(const FileMap& files, absl::StatusCode code = absl::StatusCode::kInvalidArgument) {
    fs::remove_all(Data());
    fs::create_directory(Data());
    WriteFolder(files, Data());
    const absl::Status status = Import(Data());
    EXPECT_EQ(status.code(), code) << status;
    return std::string(status.message());
  }

  std::string ZipRefusal(const FileMap& files, ZipPacking packing, absl::StatusCode code) {
    const fs::path path = scratch_.path() / "a.zip";
    WriteZip(files, path, packing);
    const absl::Status status = Import(path);
    EXPECT_EQ(status.code(), code) << status;
    return std::string(status.message());
  }

  TempFolder scratch_;
};

std::string ManifestCsv(const std::string& records) {
  return "file,lightPolarDeg,lightAzimuthDeg,viewPolarDeg,viewAzimuthDeg,scale\n" + records;
}

TEST_F(ImportErrorsTest, MissingImagesAreNamed) {
  const auto btf = TinyBtf();
  FileMap files = Ubo2003Files(*btf, TestImageKind::kPng8, "");
  files.erase(Ubo2003Name(*btf, 1, 2, ".png"));
  files.erase(Ubo2003Name(*btf, 3, 0, ".png"));
  EXPECT_THAT(Refusal(files), AllOf(HasSubstr("missing 2: "), HasSubstr("light (70, 90) view (70, 0)"),
                                    HasSubstr("light (0, 0) view (70, 240)"), Not(HasSubstr("duplicate"))));
  // Only the first few of many.
  for (int light = 1; light < 5; ++light) {
    files.erase(Ubo2003Name(*btf, 2, light, ".png"));
    files.erase(Ubo2003Name(*btf, 0, light, ".png"));
  }
  EXPECT_THAT(Refusal(files), AllOf(HasSubstr("missing 10: "), HasSubstr("and 5 more")));
}

TEST_F(ImportErrorsTest, DuplicateImagesAreNamed) {
  const auto btf = TinyBtf();
  FileMap files = Ubo2003Files(*btf, TestImageKind::kPng8, "A/");
  const std::string name = Ubo2003Name(*btf, 1, 2, ".png");
  files["B/" + name] = files["A/" + name];
  EXPECT_THAT(Refusal(files),
              AllOf(HasSubstr("duplicate 1: A/" + name + " and B/" + name), Not(HasSubstr("missing"))));
  // At the pole the azimuth says nothing.
  files = Ubo2003Files(*btf, TestImageKind::kPng8, "");
  files["tv000_pv090/00099 tl070 pl090 tv000 pv090.png"] = files[Ubo2003Name(*btf, 0, 2, ".png")];
  EXPECT_THAT(Refusal(files), HasSubstr("duplicate 1: tv000_pv000/"));
}

TEST_F(ImportErrorsTest, DifferentlySizedImagesAreNamed) {
  const auto btf = TinyBtf();
  FileMap files = Ubo2003Files(*btf, TestImageKind::kPng8, "");
  const std::string name = Ubo2003Name(*btf, 0, 0, ".png");  // the first, yet it is the odd one out
  files[name] = MakePng(CodeImage(6, 4, 3), 8);
  EXPECT_THAT(Refusal(files),
              AllOf(HasSubstr("1 of 20 images differ in size"), HasSubstr(name + ": 6x4, expected 6x5")));
}

TEST_F(ImportErrorsTest, UnreadableImagesAreNamed) {
  const auto btf = TinyBtf();
  for (const TestImageKind kind : {TestImageKind::kPng8, TestImageKind::kJpeg, TestImageKind::kExrHalf}) {
    const FileMap good = Ubo2003Files(*btf, kind, "");
    const std::string& name = std::next(good.begin(), 7)->first;
    FileMap files = good;
    files[name] = "not an image";
    EXPECT_THAT(Refusal(files), AllOf(HasSubstr("1 of 20 images cannot be read"), HasSubstr(name)));
    files[name] = "";
    EXPECT_THAT(Refusal(files), HasSubstr(name + ": empty"));
    // Cut in the middle of its pixels: the header is whole.
    files[name] = good.at(name).substr(0, good.at(name).size() - 30);
    EXPECT_THAT(Refusal(files, absl::StatusCode::kDataLoss), HasSubstr(name));
    EXPECT_THAT(ZipRefusal(files, ZipPacking::kDeflated, absl::StatusCode::kDataLoss), HasSubstr(name));
  }
}

TEST_F(ImportErrorsTest, CmykIsNamed) {
  FileMap files = Ubo2003Files(*TinyBtf(), TestImageKind::kJpeg, "");
  files.begin()->second = MakeJpeg(CodeImage(6, 5, 4));
  EXPECT_THAT(Refusal(files), HasSubstr(files.begin()->first + ": CMYK JPEG"));
}

TEST_F(ImportErrorsTest, ValuesThatAreNotFiniteAreNamed) {
  for (const float value : {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity(),
                            -std::numeric_limits<float>::infinity()}) {
    for (const ExrDepth depth : {ExrDepth::kHalf, ExrDepth::kFloat}) {
      const auto btf = TinyBtf();
      FileMap files = Ubo2003Files(*btf, TestImageKind::kExrFloat, "");
      Image image(6, 5, 3);
      image.at(4, 3)[2] = value;
      const std::string name = Ubo2003Name(*btf, 2, 1, ".exr");
      files[name] = EncodeExr(image, depth).value();
      EXPECT_THAT(Refusal(files), HasSubstr(name + ": value at x 4, y 3, channel 2 is not a finite number"));
    }
  }
}

TEST_F(ImportErrorsTest, MisnamedImagesInViewFoldersAreNamed) {
  FileMap files = Ubo2003Files(*TinyBtf(), TestImageKind::kPng8, "");
  files["preview.png"] = "anything";             // outside: ignored
  files["tv000_pv000/readme.txt"] = "anything";  // no image: ignored
  WriteFolder(files, Data());
  EXPECT_TRUE(Import(Data()).ok());
  files["tv000_pv000/00001 tl15 pl000.png"] = "anything";
  EXPECT_THAT(Refusal(files), HasSubstr("'tv000_pv000/00001 tl15 pl000.png' is not named"));
  files.erase("tv000_pv000/00001 tl15 pl000.png");
  files["tv015_pv000/00001 tl070 pl090 tv000 pv000.png"] = "anything";
  EXPECT_THAT(Refusal(files), HasSubstr("disagrees with its folder"));
}

TEST_F(ImportErrorsTest, ManifestFaultsAreNamed) {
  const std::string png = MakePng(CodeImage(2, 2, 3), 8);
  const auto csv = [&](const std::string& records) {
    return Refusal({{"a.png", png}, {"b.png", png}, {"manifest.csv", ManifestCsv(records)}});
  };
  EXPECT_THAT(csv("a.png,0,0,0,0,1\n../b.png,5,0,0,0,1\n"),
              HasSubstr("'../b.png' leaves the manifest's folder"));
  EXPECT_THAT(csv("a.png,0,0,0,0,1\n/etc/passwd,5,0,0,0,1\n"), HasSubstr("'/etc/passwd' leaves"));
  EXPECT_THAT(csv("a.png,0,0,0,0,1\nx/../../b.png,5,0,0,0,1\n"), HasSubstr("leaves the manifest's folder"));
  EXPECT_THAT(csv("a.png,0,0,0,0,1\nc.png,5,0,0,0,1\n"),
              HasSubstr("1 of 2 files of the manifest are missing: c.png"));
  EXPECT_THAT(csv("a.png,0,0,0,0,1\na.png,5,0,0,0,1\n"), HasSubstr("'a.png' is named twice"));
  EXPECT_THAT(csv("a.png,0,0,0,0,1\nb.png,5,0,0,zero,1\n"),
              HasSubstr("manifest.csv: record 3: viewAzimuthDeg 'zero' is not a number"));
  EXPECT_THAT(csv("a.png,0,0,0,0,1\nb.png,5,0,0,0\n"), HasSubstr("record 3: 5 fields"));
  EXPECT_THAT(csv("a.png,0,0,0,0,1\nb.png,5,0,0,0,-1\n"), HasSubstr("'b.png' has scale -1"));
  EXPECT_THAT(csv("a.png,0,0,0,0,1\nb.png,91,0,0,0,1\n"),
              AllOf(HasSubstr("b.png"), HasSubstr("polar 0 to 90")));
  EXPECT_THAT(csv("a.png,0,0,0,0,1\nb.png,nan,0,0,0,1\n"), HasSubstr("polar 0 to 90"));
  EXPECT_THAT(csv("\"a.png,0,0\n"), HasSubstr("quote is not closed"));
  EXPECT_THAT(csv(""), HasSubstr("0 images"));
  EXPECT_THAT(Refusal({{"manifest.csv", "file,lightPolarDeg,lightAzimuthDeg,viewPolarDeg,size\n"}}),
              HasSubstr("column 'size' is unknown"));
  EXPECT_THAT(Refusal({{"manifest.csv", "file,lightPolarDeg,lightAzimuthDeg,viewPolarDeg\n"}}),
              HasSubstr("column 'viewAzimuthDeg' is there 0 times"));
  EXPECT_THAT(Refusal({{"manifest.csv", ManifestCsv("")}, {"manifest.json", "{}"}}),
              HasSubstr("several manifests"));

  const auto json = [&](const std::string& text) {
    return Refusal({{"a.png", png}, {"manifest.json", text}});
  };
  const std::string angles =
      R"("lightPolarDeg": 0, "lightAzimuthDeg": 0, "viewPolarDeg": 0, "viewAzimuthDeg": 0)";
  EXPECT_THAT(json("{"), HasSubstr("not JSON"));
  EXPECT_THAT(json("[]"), HasSubstr("no array 'images'"));
  EXPECT_THAT(json(R"({"images": [{"file": "a.png"}]})"), HasSubstr("image 0: needs file"));
  EXPECT_THAT(json(R"({"images": [{"file": "a.png", "sclae": 2, )" + angles + "}]}"),
              HasSubstr("key 'sclae' is unknown"));
  EXPECT_THAT(json(R"({"images": [{"file": 7, )" + angles + "}]}"), HasSubstr("'file' is of the wrong type"));
  EXPECT_THAT(json(R"({"transfer": "rec709", "images": []})"), HasSubstr("transfer 'rec709'"));
}

TEST_F(ImportErrorsTest, ExrFaultsAreNamed) {
  Image image(4, 4, 3);
  EXPECT_THAT(Refusal({{"a.exr", EncodeExr(image).value()}}), HasSubstr("part 0 has no lightPolarDeg"));
  const std::string whole = MultiPartExr(*TinyBtf(), ExrPartKind::kHalf);
  for (const size_t share : {1, 10, 50, 90, 99}) {
    EXPECT_THAT(
        Refusal({{"a.exr", whole.substr(0, whole.size() * share / 100)}}, absl::StatusCode::kDataLoss),
        HasSubstr("a.exr"));
  }
}

TEST_F(ImportErrorsTest, UnknownAndAbsentPathsAreNamed) {
  EXPECT_EQ(Import(scratch_.path() / "nothing").code(), absl::StatusCode::kNotFound);
  EXPECT_THAT(Refusal({{"a.png", "x"}, {"b.txt", "y"}}), HasSubstr("no layout recognised"));
  EXPECT_THAT(Refusal({}), HasSubstr("no layout recognised"));
  EXPECT_EQ(ImportBtf("/tmp", {.memory_budget_bytes = 1}, RunContext{}).status().code(),
            absl::StatusCode::kInvalidArgument);
}

TEST_F(ImportErrorsTest, HostileArchivesAreRefusedBeforeTheyAreRead) {
  using absl::StatusCode;
  const FileMap good = Ubo2003Files(*TinyBtf(), TestImageKind::kPng8, "");
  FileMap files = good;
  files["tv000_pv000/bomb.bin"] = std::string(8 << 20, '\0');
  EXPECT_THAT(ZipRefusal(files, ZipPacking::kDeflated, StatusCode::kResourceExhausted),
              AllOf(HasSubstr("bomb.bin"), HasSubstr("200 times")));
  // Many small ones.
  files = good;
  for (int i = 0; i < 70; ++i) {
    files["bomb" + std::to_string(i)] = std::string(1 << 20, '\0');
  }
  EXPECT_THAT(ZipRefusal(files, ZipPacking::kDeflated, StatusCode::kResourceExhausted),
              HasSubstr("200 times"));
  for (const char* name :
       {"../escape.png", "/absolute.png", "a/../../b.png", "..\\windows.png", "C:/drive.png"}) {
    files = good;
    files[name] = "x";
    EXPECT_THAT(ZipRefusal(files, ZipPacking::kStored, StatusCode::kInvalidArgument),
                AllOf(HasSubstr("1 of 21 entries refused"), HasSubstr("leaves the archive")));
  }
  files.clear();
  for (int i = 0; i < 200'001; ++i) {
    files[std::to_string(i)] = "";
  }
  EXPECT_THAT(ZipRefusal(files, ZipPacking::kStored, StatusCode::kResourceExhausted),
              HasSubstr("200001 entries, the limit is 200000"));
}

TEST_F(ImportErrorsTest, ArchiveKindsThatAreNotReadAreNamed) {
  const fs::path path = scratch_.path() / "a.zip";
  WriteZip(Ubo2003Files(*TinyBtf(), TestImageKind::kPng8, ""), path, ZipPacking::kStored);
  std::ifstream in(path, std::ios::binary);
  const std::string whole{std::istreambuf_iterator<char>(in), {}};
  const auto refusal = [&](size_t offset_in_entry, char value) {
    std::string bytes = whole;
    bytes[bytes.find("PK\x01\x02") + offset_in_entry] = value;  // the first entry of the central directory
    std::ofstream(path, std::ios::binary) << bytes;
    const absl::Status status = Import(path);
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument) << status;
    return std::string(status.message());
  };
  EXPECT_THAT(refusal(8, 1), HasSubstr("is encrypted"));
  EXPECT_THAT(refusal(10, 12), HasSubstr("compression method 12"));
}

TEST_F(ImportErrorsTest, AFlippedByteInAnArchivedJpegIsNamed) {
  FileMap files = Ubo2003Files(*TinyBtf(), TestImageKind::kJpeg, "");
  const std::string& name = std::next(files.begin(), 11)->first;
  const std::string jpeg = files.at(name);
  // Padded so that the reader, which reads 16 KiB at a time, has all it wants before the archive has seen the
  // end.
  files[name].resize(16384);
  const fs::path path = scratch_.path() / "a.zip";
  WriteZip(files, path, ZipPacking::kStored);
  std::ifstream in(path, std::ios::binary);
  const std::string whole{std::istreambuf_iterator<char>(in), {}};
  const size_t begin = whole.find(name) + name.size();
  for (size_t i = 0; i < jpeg.size(); ++i) {
    std::string bytes = whole;
    bytes[begin + i] = static_cast<char>(bytes[begin + i] ^ 4);
    std::ofstream(path, std::ios::binary) << bytes;
    const absl::Status status = Import(path);
    ASSERT_FALSE(status.ok()) << "byte " << i;
    ASSERT_THAT(std::string(status.message()), HasSubstr(name));
  }
}

TEST_F(ImportErrorsTest, DamagedArchivesNeverCrash) {
  const fs::path path = scratch_.path() / "a.zip";
  WriteZip(Ubo2003Files(*TinyBtf(), TestImageKind::kPng8, ""), path, ZipPacking::kDeflated);
  std::ifstream in(path, std::ios::binary);
  const std::string whole{std::istreambuf_iterator<char>(in), {}};
  for (size_t size = 4; size < whole.size(); size += 37) {
    std::ofstream(path, std::ios::binary) << whole.substr(0, size);
    EXPECT_FALSE(Import(path).ok()) << size;
  }
  size_t refused = 0;
  for (size_t i = 0; i < whole.size(); i += 23) {
    std::string bytes = whole;
    bytes[i] = static_cast<char>(~bytes[i]);
    std::ofstream(path, std::ios::binary) << bytes;
    refused += Import(path).ok() ? 0 : 1;
  }
  EXPECT_GT(refused, whole.size() / 23 / 2);  // dates and the like may change unnoticed
}

TEST_F(ImportErrorsTest, AFullDiskIsSeenBeforeAnythingIsDecoded) {
  // Headers alone: 81 x 81 images of 16384 x 16384 x 3 16-bit samples would be 10 TB.
  FileMap files;
  std::string manifest = ManifestCsv("");
  const std::string header = MakePngHeader(16384, 16384, 3, 16);
  for (int view = 0; view < 81; ++view) {
    for (int light = 0; light < 81; ++light) {
      const std::string name = std::to_string(view) + "_" + std::to_string(light);
      files[name] = header;
      manifest += name + "," + std::to_string(light) + ",0," + std::to_string(view) + ",0,1\n";
    }
  }
  files["manifest.csv"] = manifest;
  EXPECT_THAT(
      ZipRefusal(files, ZipPacking::kStored, absl::StatusCode::kResourceExhausted),
      AllOf(HasSubstr("spill file needs 10567230160896 bytes"), HasSubstr("are free"), HasSubstr("spill")));
}

TEST_F(ImportErrorsTest, AnAbsentSpillFolderIsNamed) {
  WriteFolder(Ubo2003Files(*AsymmetricBtf(64, 64, WholeDegreeDirections(1, 9), WholeDegreeDirections(1, 9)),
                           TestImageKind::kPng8, ""),
              Data());
  const auto import = [&](const fs::path& spill) {
    return ImportBtf(Data(), {.memory_budget_bytes = kMinImportBudgetBytes, .spill_folder = spill},
                     RunContext{});
  };
  const absl::Status status = import(scratch_.path() / "absent").status();
  EXPECT_EQ(status.code(), absl::StatusCode::kNotFound);
  EXPECT_THAT(std::string(status.message()), AllOf(HasSubstr("absent"), HasSubstr("spill file")));
  // With it, the file is there as long as the source is, and never has a name.
  const size_t open_before = NumOpenFiles();
  {
    const auto source = import(Spill());
    ASSERT_TRUE(source.ok()) << source.status();
    EXPECT_EQ(NumOpenFiles(), open_before + 1);
    EXPECT_TRUE(fs::is_empty(Spill()));
  }
  EXPECT_EQ(NumOpenFiles(), open_before);
}

TEST_F(ImportErrorsTest, CancelStopsQuicklyAndLeavesNothing) {
  const auto btf = AsymmetricBtf(64, 64, WholeDegreeDirections(2, 12), WholeDegreeDirections(2, 8));
  WriteFolder(Ubo2003Files(*btf, TestImageKind::kPng8, ""), Data());
  for (const std::string_view stage : {"check", "images"}) {
    const size_t open_before = NumOpenFiles();
    std::stop_source stop;
    RunContext context;
    context.stop = stop.get_token();
    uint64_t last = 0;
    std::chrono::steady_clock::time_point requested;
    context.progress = [&](const Progress& progress) {
      EXPECT_EQ(progress.total, 25u * 17u);
      EXPECT_EQ(progress.unit, "images");
      EXPECT_TRUE(progress.done == last + 1 || progress.done == 0);
      last = progress.done;
      if (progress.stage == stage && progress.done == 40) {
        requested = std::chrono::steady_clock::now();
        stop.request_stop();
      }
    };
    const auto source =
        ImportBtf(Data(), {.memory_budget_bytes = kMinImportBudgetBytes, .spill_folder = Spill()}, context);
    EXPECT_EQ(source.status().code(), absl::StatusCode::kCancelled) << source.status();
    EXPECT_LT(std::chrono::steady_clock::now() - requested, std::chrono::seconds(1));
    EXPECT_LT(last, 60u);
    EXPECT_EQ(NumOpenFiles(), open_before);
    EXPECT_TRUE(fs::is_empty(Spill()));
  }
}

#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)  // sanitizers keep freed memory
// Peak and current resident set, bytes.
uint64_t StatusBytes(const std::string& key) {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);) {
    if (line.starts_with(key + ":")) {
      return std::strtoull(line.c_str() + key.size() + 1, nullptr, 10) << 10;
    }
  }
  return 0;
}

TEST_F(ImportErrorsTest, MemoryStaysWithinTheBudget) {
  // 12.6 MB an image, 101 MB in all.
  FileMap files;
  CodeImage image(2048, 2048, 3);
  for (size_t i = 0; i < image.codes.size(); ++i) {
    image.codes[i] = static_cast<uint16_t>(i / 7 % 256);
  }
  const std::string png = MakePng(image, 8);
  std::string manifest = ManifestCsv("");
  for (int light = 0; light < 8; ++light) {
    const std::string name = std::to_string(light) + ".png";
    files[name] = png;
    manifest += name + "," + std::to_string(light) + ",0,0,0,1\n";
  }
  files["manifest.csv"] = manifest;
  WriteFolder(files, Data());
  files.clear();
  image = CodeImage(1, 1, 3);
  constexpr uint64_t kBudget = uint64_t{8} << 20;
  constexpr uint64_t kSlack = uint64_t{6}
                              << 20;  // code, stacks and libraries' buffers touched for the first time
  std::ofstream("/proc/self/clear_refs") << "5";  // starts the peak anew
  const uint64_t before = StatusBytes("VmRSS");
  const auto source =
      ImportBtf(Data(), {.memory_budget_bytes = kBudget, .spill_folder = Spill()}, RunContext{});
  ASSERT_TRUE(source.ok()) << source.status();
  EXPECT_LT(StatusBytes("VmHWM") - before, kBudget + kSlack);
}
#endif

}  // namespace
}  // namespace tessera
