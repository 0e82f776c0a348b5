#include "tests/support/image_files.h"

#include <array>
#include <cstddef>
#include <cstdio>
#include <cstdlib>

#include <jpeglib.h>
#include <png.h>
#include <zlib.h>

namespace tessera {

namespace {

constexpr int kPngTypes[] = {0, PNG_COLOR_TYPE_GRAY, PNG_COLOR_TYPE_GRAY_ALPHA, PNG_COLOR_TYPE_RGB,
                             PNG_COLOR_TYPE_RGB_ALPHA};

void AppendBigEndian32(std::string& bytes, uint32_t value) {
  for (int shift = 24; shift >= 0; shift -= 8) {
    bytes.push_back(static_cast<char>(value >> shift));
  }
}

}  // namespace

std::string MakePng(const CodeImage& image, int bits, PngLayout layout) {
  std::string bytes;
  // The default error handler aborts, which is what a test wants.
  png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, nullptr, nullptr, nullptr);
  png_infop info = png_create_info_struct(png);
  png_set_write_fn(
      png, &bytes,
      [](png_structp sink, png_bytep data, size_t count) {
        static_cast<std::string*>(png_get_io_ptr(sink))->append(reinterpret_cast<char*>(data), count);
      },
      [](png_structp) {});
  png_set_IHDR(png, info, image.width, image.height, bits, kPngTypes[image.channels],
               layout == PngLayout::kInterlaced ? PNG_INTERLACE_ADAM7 : PNG_INTERLACE_NONE,
               PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
  png_write_info(png, info);
  const size_t row_samples = static_cast<size_t>(image.width) * image.channels;
  std::vector<uint8_t> data;
  for (const uint16_t code : image.codes) {
    if (bits == 16) {
      data.push_back(static_cast<uint8_t>(code >> 8));
    }
    data.push_back(static_cast<uint8_t>(code));
  }
  std::vector<png_bytep> rows;
  for (int y = 0; y < image.height; ++y) {
    rows.push_back(data.data() + y * row_samples * (bits / 8));
  }
  png_write_image(png, rows.data());
  png_write_end(png, info);
  png_destroy_write_struct(&png, &info);
  return bytes;
}

std::string MakePngHeader(int width, int height, int channels, int bits) {
  const auto chunk = [](std::string body) {
    std::string bytes;
    AppendBigEndian32(bytes, static_cast<uint32_t>(body.size() - 4));
    const auto crc = crc32(0, reinterpret_cast<const Bytef*>(body.data()), static_cast<uInt>(body.size()));
    bytes += body;
    AppendBigEndian32(bytes, static_cast<uint32_t>(crc));
    return bytes;
  };
  std::string header = "IHDR";
  AppendBigEndian32(header, static_cast<uint32_t>(width));
  AppendBigEndian32(header, static_cast<uint32_t>(height));
  header += {static_cast<char>(bits), static_cast<char>(kPngTypes[channels]), 0, 0, 0};
  return "\x89PNG\r\n\x1a\n" + chunk(header) + chunk("IDAT") + chunk("IEND");
}

std::string MakeJpeg(const CodeImage& image, JpegLayout layout) {
  jpeg_compress_struct state{};
  jpeg_error_mgr errors{};
  state.err = jpeg_std_error(&errors);
  jpeg_create_compress(&state);
  unsigned char* data = nullptr;
  unsigned long size = 0;
  jpeg_mem_dest(&state, &data, &size);
  state.image_width = static_cast<JDIMENSION>(image.width);
  state.image_height = static_cast<JDIMENSION>(image.height);
  state.input_components = image.channels;
  state.in_color_space = image.channels == 1 ? JCS_GRAYSCALE : image.channels == 3 ? JCS_RGB : JCS_CMYK;
  jpeg_set_defaults(&state);
  jpeg_set_quality(&state, 100, TRUE);
  for (int i = 0; i < state.num_components; ++i) {
    state.comp_info[i].h_samp_factor = 1;
    state.comp_info[i].v_samp_factor = 1;
  }
  if (layout == JpegLayout::kProgressive) {
    jpeg_simple_progression(&state);
  }
  jpeg_start_compress(&state, TRUE);
  std::vector<uint8_t> row(static_cast<size_t>(image.width) * image.channels);
  for (int y = 0; y < image.height; ++y) {
    for (size_t i = 0; i < row.size(); ++i) {
      row[i] = static_cast<uint8_t>(image.codes[y * row.size() + i]);
    }
    JSAMPROW pointer = row.data();
    jpeg_write_scanlines(&state, &pointer, 1);
  }
  jpeg_finish_compress(&state);
  std::string bytes(reinterpret_cast<char*>(data), size);
  jpeg_destroy_compress(&state);
  std::free(data);
  return bytes;
}

namespace {

using RgbePixel = std::array<char, 4>;

void AppendPixelRuns(const std::vector<RgbePixel>& row, std::string& bytes) {
  for (size_t x = 0; x < row.size();) {
    size_t end = x + 1;
    while (end < row.size() && row[end] == row[x]) {
      ++end;
    }
    bytes.append(row[x].data(), 4);
    for (size_t repeats = end - x - 1; repeats > 0; repeats >>= 8) {
      bytes.append({1, 1, 1, static_cast<char>(repeats & 255)});
    }
    x = end;
  }
}

void AppendComponentRuns(const std::vector<RgbePixel>& row, std::string& bytes) {
  bytes.append({2, 2, static_cast<char>(row.size() >> 8), static_cast<char>(row.size() & 255)});
  for (size_t component = 0; component < 4; ++component) {
    const auto run_at = [&](size_t x) {
      size_t end = x + 1;
      while (end < row.size() && end - x < 127 && row[end][component] == row[x][component]) {
        ++end;
      }
      return end - x;
    };
    for (size_t x = 0; x < row.size();) {
      if (const size_t run = run_at(x); run > 2) {
        bytes.append({static_cast<char>(128 + run), row[x][component]});
        x += run;
        continue;
      }
      size_t end = x;
      while (end < row.size() && end - x < 128 && run_at(end) <= 2) {
        ++end;
      }
      bytes.push_back(static_cast<char>(end - x));
      for (; x < end; ++x) {
        bytes.push_back(row[x][component]);
      }
    }
  }
}

}  // namespace

std::string MakeRadiance(const CodeImage& image, RadianceLayout layout, const std::string& variables) {
  std::string bytes = "#?RADIANCE\n" + variables + "\n-Y " + std::to_string(image.height) + " +X " +
                      std::to_string(image.width) + "\n";
  for (int y = 0; y < image.height; ++y) {
    std::vector<RgbePixel> row(image.width);
    for (size_t i = 0; i < row.size() * 4; ++i) {
      row[i / 4][i % 4] = static_cast<char>(image.codes[y * row.size() * 4 + i]);
    }
    switch (layout) {
      case RadianceLayout::kPlain:
        for (const RgbePixel& pixel : row) {
          bytes.append(pixel.data(), 4);
        }
        break;
      case RadianceLayout::kPixelRuns:
        AppendPixelRuns(row, bytes);
        break;
      case RadianceLayout::kComponentRuns:
        AppendComponentRuns(row, bytes);
        break;
    }
  }
  return bytes;
}

}  // namespace tessera
