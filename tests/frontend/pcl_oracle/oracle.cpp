// SIFT key points and CSHOT descriptors of a cloud as the Point Cloud Library computes them, for the fixture that
// tests/frontend/test_cloud_features.py compares with. make_fixture.py builds and runs it:
//
//     apt-get install g++ pkg-config libpcl-dev
//     python tests/frontend/pcl_oracle/make_fixture.py
//
// Input, little-endian: int32 n, m, octaves, scales; float32 sigma, contrast, radius; n rows of 9 float32 (point,
// colour 0 to 255, normal), of which the first m are described. Output: int32 k, k rows of 4 float32 (key point, scale),
// then m rows of 9 (frame, axis by axis) + 1344 float32.
#include <pcl/features/shot.h>
#include <pcl/keypoints/sift_keypoint.h>

#include <cstdint>
#include <fstream>
#include <numeric>
#include <vector>

int main(int, char** arguments) {
  std::ifstream in(arguments[1], std::ios::binary);
  std::int32_t counts[4];
  float numbers[3];
  in.read(reinterpret_cast<char*>(counts), sizeof counts);
  in.read(reinterpret_cast<char*>(numbers), sizeof numbers);
  const std::int32_t n = counts[0], m = counts[1];
  std::vector<float> rows(9 * n);
  in.read(reinterpret_cast<char*>(rows.data()), rows.size() * sizeof(float));
  if (!in) return 2;

  pcl::PointCloud<pcl::PointXYZI>::Ptr grey(new pcl::PointCloud<pcl::PointXYZI>);
  pcl::PointCloud<pcl::PointXYZRGB>::Ptr colored(new pcl::PointCloud<pcl::PointXYZRGB>);
  pcl::PointCloud<pcl::Normal>::Ptr normals(new pcl::PointCloud<pcl::Normal>);
  for (std::int32_t i = 0; i < n; ++i) {
    const float* row = rows.data() + 9 * i;
    pcl::PointXYZI dot;
    dot.x = row[0], dot.y = row[1], dot.z = row[2];
    dot.intensity = 0.299f * row[3] + 0.587f * row[4] + 0.114f * row[5];
    grey->push_back(dot);
    pcl::PointXYZRGB point;
    point.x = row[0], point.y = row[1], point.z = row[2];
    point.r = std::uint8_t(row[3]), point.g = std::uint8_t(row[4]), point.b = std::uint8_t(row[5]);
    colored->push_back(point);
    normals->push_back(pcl::Normal(row[6], row[7], row[8]));
  }

  pcl::SIFTKeypoint<pcl::PointXYZI, pcl::PointWithScale> sift;
  pcl::PointCloud<pcl::PointWithScale> found;
  sift.setScales(numbers[0], counts[2], counts[3]);
  sift.setMinimumContrast(numbers[1]);
  sift.setInputCloud(grey);
  sift.compute(found);

  pcl::SHOTColorEstimation<pcl::PointXYZRGB, pcl::Normal, pcl::SHOT1344> cshot;
  pcl::PointCloud<pcl::SHOT1344> described;
  pcl::IndicesPtr chosen(new pcl::Indices(m));
  std::iota(chosen->begin(), chosen->end(), 0);
  cshot.setInputCloud(colored);
  cshot.setInputNormals(normals);
  cshot.setIndices(chosen);
  cshot.setRadiusSearch(numbers[2]);
  cshot.compute(described);

  std::ofstream out(arguments[2], std::ios::binary);
  const std::int32_t k = std::int32_t(found.size());
  out.write(reinterpret_cast<const char*>(&k), sizeof k);
  for (const auto& point : found) {
    const float row[4] = {point.x, point.y, point.z, point.scale};
    out.write(reinterpret_cast<const char*>(row), sizeof row);
  }
  for (const auto& row : described) {
    out.write(reinterpret_cast<const char*>(row.rf), sizeof row.rf);
    out.write(reinterpret_cast<const char*>(row.descriptor), sizeof row.descriptor);
  }
  return out ? 0 : 1;
}
