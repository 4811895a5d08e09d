/* A disk that fails: preloaded, it lets calls that write to files below one folder fail from a given one on. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/types.h>
#include <sys/uio.h>
#include <unistd.h>

static char folder[4096], failed[4096];
static long calls, first = -1;
static int once, number;

/* Let call `start` (from 0) below `where` fail with the error `error`: that one alone, or all from there on.
   Error 0 is none: writes take half of what they are given, as they may. */
void disk_fails(const char *where, long start, int error, int alone) {
    strncpy(folder, where, sizeof folder - 1);
    calls = 0, first = start, number = error, once = alone, failed[0] = 0;
}

long disk_calls(void) { return calls; }

/* The file of the first call that failed; empty if none did. */
const char *disk_failed(void) { return failed; }

static int below(const char *path) { return folder[0] && strncmp(path, folder, strlen(folder)) == 0; }

static int counted(const char *path) {
    long call = calls++;
    if (first < 0 || call < first || (once && call > first)) return 0;
    if (call == first) strncpy(failed, path, sizeof failed - 1);
    errno = number;
    return 1;
}

static int fails(int fd) {
    char link[64], path[4096];
    struct stat found;
    if (!folder[0] || fstat(fd, &found) || !S_ISREG(found.st_mode)) return 0;
    snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
    ssize_t length = readlink(link, path, sizeof path - 1);
    if (length < 0) return 0;
    path[length] = 0;
    return below(path) && counted(path);
}

#define REAL(name) static __typeof__(name) *real; if (!real) real = dlsym(RTLD_NEXT, #name)

#define REFUSED(fd) (fails(fd) && number)
#define TAKEN(fd, size) (!fails(fd) ? (size) : number ? 0 : ((size) + 1) / 2)
#define WRITTEN(fd, size, call) size_t taken = TAKEN(fd, size); return size && !taken ? -1 : call

ssize_t write(int fd, const void *data, size_t size) { REAL(write); WRITTEN(fd, size, real(fd, data, taken)); }
ssize_t writev(int fd, const struct iovec *data, int count) { REAL(writev); WRITTEN(fd, (size_t)count, real(fd, data, (int)taken)); }
ssize_t pwrite(int fd, const void *data, size_t size, off_t at) { REAL(pwrite); WRITTEN(fd, size, real(fd, data, taken, at)); }
ssize_t pwrite64(int fd, const void *data, size_t size, off64_t at) { REAL(pwrite64); WRITTEN(fd, size, real(fd, data, taken, at)); }
int ftruncate(int fd, off_t size) { REAL(ftruncate); return REFUSED(fd) ? -1 : real(fd, size); }
int ftruncate64(int fd, off64_t size) { REAL(ftruncate64); return REFUSED(fd) ? -1 : real(fd, size); }
int fsync(int fd) { REAL(fsync); return REFUSED(fd) ? -1 : real(fd); }
int posix_fallocate(int fd, off_t at, off_t size);
int posix_fallocate(int fd, off_t at, off_t size) { REAL(posix_fallocate); return REFUSED(fd) ? number : real(fd, at, size); }
int posix_fallocate64(int fd, off64_t at, off64_t size);
int posix_fallocate64(int fd, off64_t at, off64_t size) { REAL(posix_fallocate64); return REFUSED(fd) ? number : real(fd, at, size); }
int rename(const char *from, const char *to) { REAL(rename); return below(from) && counted(from) && number ? -1 : real(from, to); }
