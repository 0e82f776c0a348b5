// Small BTFs of known samples, written in every layout that can be imported, as another program would.
#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "btf/data/memory_btf.h"
#include "tests/support/image_files.h"

namespace tessera {

// Names, with '/' between folders, and contents.
using FileMap = std::map<std::string, std::string>;

// Directions at whole degrees, so that UBO2003 names can hold them.
[[nodiscard]] std::vector<Direction> WholeDegreeDirections(int num_rings, int num_azimuths);

// A BTF without any symmetry: no flip, turn, or exchange of axes, channels, or views and lights maps it to
// itself. Every sample is an sRGB code of 8 bits, so that 8-bit files hold it exactly.
[[nodiscard]] std::unique_ptr<MemoryBtf> AsymmetricBtf(int width, int height, std::vector<Direction> views,
                                                       std::vector<Direction> lights);

enum class TestImageKind { kPng8, kPng16, kJpeg, kExrHalf, kExrFloat };
// One image of a BTF: sRGB codes in PNG and JPEG, linear values in EXR.
[[nodiscard]] std::string MakeBtfImage(const MemoryBtf& btf, size_t view, size_t light, TestImageKind kind);

// tvTTT_pvPPP/NNNNN tlTTT plPPP tvTTT pvPPP.ext below `prefix` ("" or "NAME/").
[[nodiscard]] FileMap Ubo2003Files(const MemoryBtf& btf, TestImageKind kind, const std::string& prefix);
[[nodiscard]] std::string Ubo2003Name(const MemoryBtf& btf, size_t view, size_t light,
                                      const std::string& ending);
// Images in a folder of their own, and manifest.json or manifest.csv.
enum class ManifestKind { kJson, kCsv };
[[nodiscard]] FileMap ManifestFiles(const MemoryBtf& btf, TestImageKind kind, ManifestKind manifest);
// Bytes of one OpenEXR file with a part for each image.
enum class ExrPartKind { kHalf, kFloat };
[[nodiscard]] std::string MultiPartExr(const MemoryBtf& btf, ExrPartKind kind);

void WriteFolder(const FileMap& files, const std::filesystem::path& folder);
enum class ZipPacking { kStored, kDeflated };
void WriteZip(const FileMap& files, const std::filesystem::path& path, ZipPacking packing);

}  // namespace tessera
