/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Finds out what this machine has of a configuration. Nothing is opened: opening a serial port
 * moves its control lines, which some adapters and drives notice.
 */
#include "drivebridge/config.h"
#include "drivebridge/transport.h"
#include "transport/serial.h"

#include <errno.h>
#include <grp.h>
#include <inttypes.h>
#include <net/if.h>
#include <net/if_arp.h>
#include <pwd.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/sysmacros.h>
#include <unistd.h>

#define SERVICE_USER "drivebridge"
#define GROUPS_MAX 64

struct probe {
	FILE *out;
	FILE *errors;
	const char *kind; /* "bus" or "line", for messages */
	bool headed;      /* the heading of what is good has been printed */
	char user[64];    /* the user that opens the ports */
	uid_t uid;
	gid_t groups[GROUPS_MAX];
	int group_count;
};

static void add_warning(const struct probe *probe, const struct db_bus_config *bus,
                        const char *port, const char *what)
{
	fprintf(probe->errors, "%s:%u: warning: %s %s: %s %s\n", bus->source_file, bus->source_line,
	        probe->kind, bus->name, port, what);
}

static void add_good(struct probe *probe, const struct db_bus_config *bus, const char *port)
{
	if (!probe->headed)
		fputs("on this machine\n", probe->out);
	probe->headed = true;
	fprintf(probe->out, "  %s %s: %s ", probe->kind, bus->name, port);
}

/* --- the user --------------------------------------------------------------------------------- */

static bool may_open(const struct probe *probe, const struct stat *about)
{
	const mode_t both = S_IROTH | S_IWOTH;
	mode_t mode = about->st_mode;
	bool member = probe->uid == geteuid() && about->st_gid == getegid();

	for (int i = 0; !member && i < probe->group_count && i < GROUPS_MAX; i++)
		member = probe->groups[i] == about->st_gid;
	if (probe->uid == 0)
		return true;
	if (about->st_uid == probe->uid)
		mode >>= 6;
	else if (member)
		mode >>= 3;
	return (mode & both) == both;
}

/* --- serial ports ----------------------------------------------------------------------------- */

/* True if the kernel's list of terminal drivers has it as one of `types`, or if there is no list,
 * as in the sandbox of the service. */
static bool is_terminal(dev_t device)
{
	FILE *list = fopen("/proc/tty/drivers", "re");
	char line[256];
	bool found = !list;

	while (!found && fgets(line, sizeof(line), list)) {
		unsigned number, first, last;
		char range[64];
		char type[64];

		if (sscanf(line, "%*s %*s %u %63s %63s", &number, range, type) != 3 ||
		    number != major(device))
			continue;
		if (sscanf(range, "%u-%u", &first, &last) != 2)
			last = first = (unsigned)strtoul(range, NULL, 10);
		found = minor(device) >= first && minor(device) <= last &&
		        (strcmp(type, "serial") == 0 || strcmp(type, "pty:slave") == 0);
	}
	if (list)
		fclose(list);
	return found;
}

static void probe_port(struct probe *probe, const struct db_bus_config *bus)
{
	struct stat about;
	struct group *group;
	char text[400];

	if (stat(bus->device, &about) != 0) {
		snprintf(text, sizeof(text),
		         "%s; is it plugged in? ls /dev/serial/by-id shows the names of USB "
		         "adapters",
		         errno == ENOENT ? "does not exist" : strerror(errno));
		add_warning(probe, bus, bus->device, text);
	} else if (!S_ISCHR(about.st_mode) || !is_terminal(about.st_rdev)) {
		add_warning(
			probe, bus, bus->device,
			"is no serial port; ls /dev/serial/by-id shows the names of USB adapters");
	} else if (!may_open(probe, &about)) {
		group = getgrgid(about.st_gid);
		if (group && about.st_gid != 0)
			snprintf(text, sizeof(text),
			         "may not be opened by %s; add it to the group of the port: sudo "
			         "adduser %s %s, and %s",
			         probe->user, probe->user, group->gr_name,
			         probe->uid == geteuid() ? "log in again" :
			                                   "sudo systemctl restart drivebridge");
		else
			snprintf(text, sizeof(text),
			         "may not be opened by %s; a udev rule can give it to the group "
			         "dialout",
			         probe->user);
		add_warning(probe, bus, bus->device, text);
	} else {
		add_good(probe, bus, bus->device);
		fprintf(probe->out, "is a serial port, and %s may open it\n", probe->user);
	}
}

/* --- CAN interfaces --------------------------------------------------------------------------- */

static void probe_interface(struct probe *probe, const struct db_bus_config *bus)
{
	int fd = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
	struct ifreq type = { 0 };
	struct ifreq flags = { 0 };

	snprintf(type.ifr_name, sizeof(type.ifr_name), "%s", bus->interface);
	memcpy(flags.ifr_name, type.ifr_name, sizeof(flags.ifr_name));
	if (if_nametoindex(bus->interface) == 0)
		add_warning(probe, bus, bus->interface,
		            "is no network interface of this machine; ip link shows them");
	else if (fd < 0 || ioctl(fd, SIOCGIFHWADDR, &type) < 0 ||
	         ioctl(fd, SIOCGIFFLAGS, &flags) < 0)
		add_warning(probe, bus, bus->interface, strerror(errno));
	else if (type.ifr_hwaddr.sa_family != ARPHRD_CAN)
		add_warning(probe, bus, bus->interface,
		            "is no CAN interface; ip -details link shows them");
	else if (!(flags.ifr_flags & IFF_UP))
		add_warning(probe, bus, bus->interface,
		            "is down; systemd-networkd sets it up, see "
		            "80-drivebridge-can.network.example");
	else {
		add_good(probe, bus, bus->interface);
		fputs("is a CAN interface, and up\n", probe->out);
	}
	if (fd >= 0)
		close(fd);
}

void db_config_probe(const struct db_config *config, FILE *out, FILE *errors)
{
	struct probe probe = { .out = out, .errors = errors, .kind = "bus" };
	/* Root may open everything: then the service's user is checked, if there is one. */
	struct passwd *user = geteuid() == 0 ? getpwnam(SERVICE_USER) : NULL;

	if (!user)
		user = getpwuid(geteuid());
	probe.uid = user ? user->pw_uid : geteuid();
	snprintf(probe.user, sizeof(probe.user), "%s", user ? user->pw_name : "this user");
	probe.group_count = GROUPS_MAX;
	if (user && probe.uid != geteuid())
		(void)getgrouplist(user->pw_name, user->pw_gid, probe.groups, &probe.group_count);
	else
		probe.group_count = getgroups(GROUPS_MAX, probe.groups);
	for (size_t i = 0; i < config->bus_count; i++) {
		const struct db_bus_config *bus = &config->buses[i];

		if (bus->transport->uses_interface)
			probe_interface(&probe, bus);
		else
			probe_port(&probe, bus);
	}
	probe.kind = "line";
	for (size_t i = 0; i < config->modbus.line_count; i++) {
		const struct db_bus_config port = db_serial_port_of_line(&config->modbus.lines[i]);

		probe_port(&probe, &port);
	}
}
