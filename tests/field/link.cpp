// A network link between two network namespaces, for kernels without netem: two TUN interfaces whose packets this
// program carries across with a delay, a rate, a loss and a bounded queue, each direction for itself.
//
//   link NAME_A NAME_B DELAY_MS RATE_MBIT LOSS_PERCENT CUT_FILE
//
// prints "ready" when both interfaces exist; drops everything while CUT_FILE exists.

#include <condition_variable>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <deque>
#include <fcntl.h>
#include <linux/if.h>
#include <linux/if_tun.h>
#include <mutex>
#include <random>
#include <string>
#include <sys/ioctl.h>
#include <thread>
#include <unistd.h>
#include <vector>

using Clock = std::chrono::steady_clock;

int openTun(const char* name) {
    const int file = open("/dev/net/tun", O_RDWR);
    ifreq request{};
    request.ifr_flags = IFF_TUN | IFF_NO_PI;
    std::snprintf(request.ifr_name, IFNAMSIZ, "%s", name);
    if (file < 0 || ioctl(file, TUNSETIFF, &request) < 0) {
        std::perror("link: /dev/net/tun");
        std::exit(1);
    }
    return file;
}

struct Link {
    Clock::duration delay;
    double bytesPerSecond, loss;
    std::string cutFile;
};

class Direction {
  public:
    Direction(int from, int to, const Link& link, unsigned seed) : from_(from), to_(to), link_(link), random_(seed) {}

    void receive() {
        std::vector<char> packet(65536);
        std::uniform_real_distribution<double> chance(0, 1);
        while (true) {
            const auto size = read(from_, packet.data(), packet.size());
            if (size <= 0) continue;
            if (access(link_.cutFile.c_str(), F_OK) == 0 || chance(random_) < link_.loss) continue;
            std::lock_guard<std::mutex> lock(mutex_);
            const auto now = Clock::now();
            // A router's buffer: what would wait longer than 40 ms for its turn is dropped.
            if (free_ > now + std::chrono::milliseconds(40)) continue;
            free_ = std::max(free_, now) + std::chrono::duration_cast<Clock::duration>(
                                               std::chrono::duration<double>(size / link_.bytesPerSecond));
            waiting_.push_back({free_ + link_.delay, std::vector<char>(packet.begin(), packet.begin() + size)});
            ready_.notify_one();
        }
    }

    void send() {
        std::unique_lock<std::mutex> lock(mutex_);
        while (true) {
            ready_.wait(lock, [this] { return !waiting_.empty(); });
            const auto due = waiting_.front().first;
            if (due > Clock::now()) {
                lock.unlock();
                std::this_thread::sleep_until(due);
                lock.lock();
            }
            const auto packet = std::move(waiting_.front().second);
            waiting_.pop_front();
            lock.unlock();
            if (write(to_, packet.data(), packet.size()) < 0) {}  // the interface may be down
            lock.lock();
        }
    }

  private:
    int from_, to_;
    const Link& link_;
    std::mt19937 random_;
    std::mutex mutex_;
    std::condition_variable ready_;
    std::deque<std::pair<Clock::time_point, std::vector<char>>> waiting_;
    Clock::time_point free_ = Clock::now();
};

int main(int count, char** arguments) {
    if (count != 7) return 2;
    const int a = openTun(arguments[1]), b = openTun(arguments[2]);
    const Link link{std::chrono::microseconds(static_cast<long>(1000 * std::atof(arguments[3]))),
                    std::atof(arguments[4]) * 1e6 / 8, std::atof(arguments[5]) / 100, arguments[6]};
    Direction there(a, b, link, 1), back(b, a, link, 2);
    std::thread threads[] = {std::thread([&] { there.receive(); }), std::thread([&] { there.send(); }),
                             std::thread([&] { back.receive(); }), std::thread([&] { back.send(); })};
    std::puts("ready");
    std::fflush(stdout);
    for (auto& thread : threads) thread.join();
}
