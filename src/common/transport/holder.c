/* SPDX-License-Identifier: Apache-2.0 */
#include "transport/transport_private.h"

#include <errno.h>
#include <limits.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/sysmacros.h>

/* 1: FLOCK  ADVISORY  WRITE 26109 00:1a:3 0 EOF */
pid_t db_port_holder_in(FILE *locks, dev_t device, ino_t inode)
{
	char line[160];

	while (fgets(line, sizeof(line), locks)) {
		unsigned long long number;
		unsigned high;
		unsigned low;
		long process;

		/* A process that only waits for a lock has an arrow there, and does not hold it. */
		if (sscanf(line, "%*u: %*s %*s %*s %ld %x:%x:%llu", &process, &high, &low,
		           &number) == 4 &&
		    process > 0 && high == major(device) && low == minor(device) && number == inode)
			return (pid_t)process;
	}
	return 0;
}

/* /run/lock/LCK..ttyUSB0 contains the number of the process as text. A leftover file belongs to no
 * process. */
static pid_t read_lock_file(const char *device)
{
	const char *name = strrchr(device, '/');
	char path[sizeof("/run/lock/LCK..") + NAME_MAX];
	long process = 0;
	FILE *file;

	snprintf(path, sizeof(path), "/run/lock/LCK..%.*s", NAME_MAX, name ? name + 1 : device);
	file = fopen(path, "re");
	if (!file)
		return 0;
	if (fscanf(file, "%ld", &process) != 1 || process <= 0 ||
	    (kill((pid_t)process, 0) != 0 && errno == ESRCH))
		process = 0;
	fclose(file);
	return (pid_t)process;
}

pid_t db_port_holder(const struct db_bus_config *bus)
{
	char path[PATH_MAX];
	struct stat about;
	pid_t process = 0;
	FILE *locks;

	if (!realpath(bus->device, path) || stat(path, &about) != 0)
		return 0;
	locks = fopen("/proc/locks", "re");
	if (locks) {
		process = db_port_holder_in(locks, about.st_dev, about.st_ino);
		fclose(locks);
	}
	return process != 0 ? process : read_lock_file(path);
}
