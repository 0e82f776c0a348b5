#include "tests/support/btf_files.h"

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <random>

#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfFloatAttribute.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfMultiPartOutputFile.h>
#include <OpenEXR/ImfOutputPart.h>
#include <OpenEXR/ImfPartType.h>
#include <zip.h>

#include "btf/base/rng.h"
#include "btf/image/image_io.h"
#include "btf/image/transfer.h"
#include "tests/support/temp_folder.h"

namespace tessera {

namespace {

int Degrees(double rad) {
  return static_cast<int>(std::lround(DegFromRad(rad)));
}

std::string Format(const char* format, int a, int b) {
  char text[64];
  std::snprintf(text, sizeof(text), format, a, b);
  return text;
}

const char* EndingOf(TestImageKind kind) {
  switch (kind) {
    case TestImageKind::kPng8:
    case TestImageKind::kPng16:
      return ".png";
    case TestImageKind::kJpeg:
      return ".jpg";
    default:
      return ".exr";
  }
}

Image LinearImage(const MemoryBtf& btf, size_t view, size_t light) {
  Image image(btf.info().width, btf.info().height, 3);
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      for (int channel = 0; channel < 3; ++channel) {
        image.at(x, y)[channel] = btf.at(x, y, channel, view, light);
      }
    }
  }
  return image;
}

}  // namespace

std::vector<Direction> WholeDegreeDirections(int num_rings, int num_azimuths) {
  std::vector<Direction> directions = {{0.0, 0.0}};
  for (int ring = 1; ring <= num_rings; ++ring) {
    for (int i = 0; i < num_azimuths; ++i) {
      directions.push_back({RadFromDeg(70 * ring / num_rings), RadFromDeg(360 * i / num_azimuths)});
    }
  }
  return directions;
}

std::unique_ptr<MemoryBtf> AsymmetricBtf(int width, int height, std::vector<Direction> views,
                                         std::vector<Direction> lights) {
  BtfInfo info;
  info.width = width;
  info.height = height;
  info.views = std::move(views);
  info.lights = std::move(lights);
  std::vector<float> samples;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      for (int channel = 0; channel < 3; ++channel) {
        for (const Direction& view : info.views) {
          for (const Direction& light : info.lights) {
            // Smooth in x and y, so that JPEG keeps it; from angles, not indices, so that the order of
            // directions does not matter.
            const double value = 0.45 + 0.2 * std::sin(0.31 * x + light.phi_rad + 0.4 * channel) +
                                 0.15 * std::cos(0.17 * y + 2.0 * view.phi_rad + light.theta_rad) +
                                 0.1 * view.theta_rad - 0.05 * x / width;
            samples.push_back(static_cast<float>(LinearFromSrgb(std::round(value * 255.0) / 255.0)));
          }
        }
      }
    }
  }
  return std::move(MemoryBtf::Create(std::move(info), std::move(samples)).value());
}

std::string MakeBtfImage(const MemoryBtf& btf, size_t view, size_t light, TestImageKind kind) {
  const Image image = LinearImage(btf, view, light);
  if (kind == TestImageKind::kExrHalf || kind == TestImageKind::kExrFloat) {
    return EncodeExr(image, kind == TestImageKind::kExrHalf ? ExrDepth::kHalf : ExrDepth::kFloat).value();
  }
  const double full = kind == TestImageKind::kPng16 ? 65535.0 : 255.0;
  CodeImage codes(image.width, image.height, 3);
  for (size_t i = 0; i < image.pixels.size(); ++i) {
    codes.codes[i] = static_cast<uint16_t>(std::lround(full * SrgbFromLinear(image.pixels[i])));
  }
  return kind == TestImageKind::kJpeg ? MakeJpeg(codes)
                                      : MakePng(codes, kind == TestImageKind::kPng16 ? 16 : 8);
}

std::string Ubo2003Name(const MemoryBtf& btf, size_t view, size_t light, const std::string& ending) {
  const Direction& v = btf.info().views[view];
  const Direction& l = btf.info().lights[light];
  const int number = static_cast<int>(light * btf.info().views.size() + view);
  return Format("tv%03d_pv%03d/", Degrees(v.theta_rad), Degrees(v.phi_rad)) + Format("%05d", number, 0) +
         Format(" tl%03d pl%03d", Degrees(l.theta_rad), Degrees(l.phi_rad)) +
         Format(" tv%03d pv%03d", Degrees(v.theta_rad), Degrees(v.phi_rad)) + ending;
}

FileMap Ubo2003Files(const MemoryBtf& btf, TestImageKind kind, const std::string& prefix) {
  FileMap files;
  for (size_t view = 0; view < btf.info().views.size(); ++view) {
    for (size_t light = 0; light < btf.info().lights.size(); ++light) {
      files[prefix + Ubo2003Name(btf, view, light, EndingOf(kind))] = MakeBtfImage(btf, view, light, kind);
    }
  }
  return files;
}

FileMap ManifestFiles(const MemoryBtf& btf, TestImageKind kind, ManifestKind manifest) {
  const bool json = manifest == ManifestKind::kJson;
  FileMap files;
  std::string text =
      json ? "{\"images\": [" : "file,viewPolarDeg,viewAzimuthDeg,lightPolarDeg,lightAzimuthDeg\n";
  const auto degrees = [](double rad) {
    char number[32];
    std::snprintf(number, sizeof(number), "%.9g", DegFromRad(rad));
    return std::string(number);
  };
  for (size_t view = 0; view < btf.info().views.size(); ++view) {
    for (size_t light = 0; light < btf.info().lights.size(); ++light) {
      const std::string name =
          Format("images/%d_%d", static_cast<int>(light), static_cast<int>(view)) + EndingOf(kind);
      files[name] = MakeBtfImage(btf, view, light, kind);
      const Direction& v = btf.info().views[view];
      const Direction& l = btf.info().lights[light];
      if (json) {
        text += std::string(view + light == 0 ? "" : ",") + "\n{\"file\": \"" + name +
                "\", \"viewPolarDeg\": " + degrees(v.theta_rad) +
                ", \"viewAzimuthDeg\": " + degrees(v.phi_rad) +
                ", \"lightPolarDeg\": " + degrees(l.theta_rad) +
                ", \"lightAzimuthDeg\": " + degrees(l.phi_rad) + "}";
      } else {
        text += name + "," + degrees(v.theta_rad) + "," + degrees(v.phi_rad) + "," + degrees(l.theta_rad) +
                "," + degrees(l.phi_rad) + "\n";
      }
    }
  }
  files[json ? "manifest.json" : "manifest.csv"] = text + (json ? "]}\n" : "");
  return files;
}

std::string MultiPartExr(const MemoryBtf& btf, ExrPartKind kind) {
  const BtfInfo& info = btf.info();
  const Imf::PixelType type = kind == ExrPartKind::kHalf ? Imf::HALF : Imf::FLOAT;
  std::vector<Imf::Header> headers;
  for (size_t view = 0; view < info.views.size(); ++view) {
    for (size_t light = 0; light < info.lights.size(); ++light) {
      Imf::Header header(info.width, info.height);
      header.setName(Format("v%d.l%d", static_cast<int>(view), static_cast<int>(light)));
      header.setType(Imf::SCANLINEIMAGE);
      for (const char* channel : {"R", "G", "B"}) {
        header.channels().insert(channel, Imf::Channel(type));
      }
      const auto insert = [&header](const char* name, double rad) {
        header.insert(name, Imf::FloatAttribute(static_cast<float>(DegFromRad(rad))));
      };
      insert("lightPolarDeg", info.lights[light].theta_rad);
      insert("lightAzimuthDeg", info.lights[light].phi_rad);
      insert("viewPolarDeg", info.views[view].theta_rad);
      insert("viewAzimuthDeg", info.views[view].phi_rad);
      headers.push_back(std::move(header));
    }
  }
  const TempFolder scratch;
  const std::filesystem::path path = scratch.path() / "parts.exr";
  {
    Imf::MultiPartOutputFile file(path.c_str(), headers.data(), static_cast<int>(headers.size()));
    for (size_t part = 0; part < headers.size(); ++part) {
      Image image = LinearImage(btf, part / info.lights.size(), part % info.lights.size());
      std::vector<half> halves(image.pixels.begin(), image.pixels.end());
      const bool is_half = kind == ExrPartKind::kHalf;
      char* const base =
          is_half ? reinterpret_cast<char*>(halves.data()) : reinterpret_cast<char*>(image.pixels.data());
      const size_t size = is_half ? 2 : 4;
      Imf::FrameBuffer frame;
      frame.insert("R", Imf::Slice(type, base, 3 * size, 3 * size * image.width));
      frame.insert("G", Imf::Slice(type, base + size, 3 * size, 3 * size * image.width));
      frame.insert("B", Imf::Slice(type, base + 2 * size, 3 * size, 3 * size * image.width));
      Imf::OutputPart output(file, static_cast<int>(part));
      output.setFrameBuffer(frame);
      output.writePixels(image.height);
    }
  }
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

void WriteFolder(const FileMap& files, const std::filesystem::path& folder) {
  for (const auto& [name, bytes] : files) {
    std::filesystem::create_directories((folder / name).parent_path());
    std::ofstream(folder / name, std::ios::binary) << bytes;
  }
}

void WriteZip(const FileMap& files, const std::filesystem::path& path, ZipPacking packing) {
  zip_t* zip = zip_open(path.c_str(), ZIP_CREATE | ZIP_TRUNCATE, nullptr);
  for (const auto& [name, bytes] : files) {
    zip_source_t* source = zip_source_buffer(zip, bytes.data(), bytes.size(), 0);
    const zip_int64_t index = zip_file_add(zip, name.c_str(), source, ZIP_FL_ENC_UTF_8);
    zip_set_file_compression(zip, static_cast<zip_uint64_t>(index),
                             packing == ZipPacking::kStored ? ZIP_CM_STORE : ZIP_CM_DEFLATE, 1);
  }
  if (zip_close(zip) != 0) {
    std::abort();
  }
}

}  // namespace tessera
