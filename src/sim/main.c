/* SPDX-License-Identifier: Apache-2.0 */
/*
 * drivebridge-sim: simulated drives on serial lines, for development and tests without hardware.
 */
#include "sim/replay.h"
#include "sim/sim_config.h"
#include "sim/sim_private.h"
#include "sim/world.h"

#include <errno.h>
#include <getopt.h>
#include <grp.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/prctl.h>
#include <sys/signalfd.h>
#include <sys/timerfd.h>
#include <time.h>
#include <unistd.h>

#define LINKS_MAX 64

struct options {
	const char *config;
	const char *replay;
	const char *control;
	const char *trace;
	bool busy;
	char *links[LINKS_MAX]; /* NAME=PATH */
	size_t link_count;
	const char *folder;
	const char *group_name;
	gid_t group; /* numeric id of the group */
};

struct loop {
	int poll;
	int timer;
	int signals;
	db_time armed; /* present setting of the timer */
};

static db_time clock_now(void)
{
	struct timespec time;

	(void)clock_gettime(CLOCK_MONOTONIC, &time);
	return (db_time)time.tv_sec * DB_NS_PER_S + time.tv_nsec;
}

static void usage(FILE *out)
{
	fputs("usage: drivebridge-sim --config FILE [--link BUS=PATH]... [--control SOCKET] "
	      "[--trace FILE]\n"
	      "                       [--links FOLDER] [--pty-group GROUP] [--busy]\n"
	      "       drivebridge-sim --replay FILE [--link replay=PATH] [--control SOCKET] "
	      "[--trace FILE]\n"
	      "  --config FILE    buses and drives, see conf/sim-demo.conf\n"
	      "  --replay FILE    the drives' side of a serial line as drivebridgectl trace "
	      "recorded it:\n"
	      "                   answers what is asked as in the file, and tells what is asked "
	      "else;\n"
	      "                   ends with 1 unless all of it was asked for\n"
	      "  --link BUS=PATH  make PATH a symbolic link to the bus's device\n"
	      "  --links FOLDER   make FOLDER/BUS a symbolic link to each pty that has no other "
	      "link\n"
	      "  --pty-group GROUP let the members of GROUP open the ptys (mode 0660)\n"
	      "  --control SOCKET take commands (faults, power ...) on this UNIX socket\n"
	      "  --trace FILE     write every request and reply with its time in microseconds, "
	      "and\n"
	      "                   what drives obey\n"
	      "  --busy           never sleep: takes a whole processor, but answers to the "
	      "microsecond (for measurements)\n",
	      out);
}

/* 0, or the exit status plus one. */
static int read_options(int argc, char **argv, struct options *options)
{
	static const struct option known[] = {
		{ "config", required_argument, NULL, 'c' },
		{ "replay", required_argument, NULL, 'r' },
		{ "link", required_argument, NULL, 'l' },
		{ "links", required_argument, NULL, 'f' },
		{ "pty-group", required_argument, NULL, 'g' },
		{ "control", required_argument, NULL, 's' },
		{ "trace", required_argument, NULL, 't' },
		{ "busy", no_argument, NULL, 'b' },
		{ "help", no_argument, NULL, 'h' },
		{ NULL, 0, NULL, 0 },
	};
	int option;

	while ((option = getopt_long(argc, argv, "c:h", known, NULL)) != -1) {
		if (option == 'c') {
			options->config = optarg;
		} else if (option == 'r') {
			options->replay = optarg;
		} else if (option == 's') {
			options->control = optarg;
		} else if (option == 't') {
			options->trace = optarg;
		} else if (option == 'f') {
			options->folder = optarg;
		} else if (option == 'g') {
			options->group_name = optarg;
		} else if (option == 'b') {
			options->busy = true;
		} else if (option == 'l' && options->link_count < LINKS_MAX) {
			options->links[options->link_count++] = optarg;
		} else {
			usage(option == 'h' ? stdout : stderr);
			return option == 'h' ? 1 : 3;
		}
	}
	if (!options->config == !options->replay || optind != argc) {
		usage(stderr);
		return 3;
	}
	return 0;
}

/* The links to ptys of buses, where the others' links are made, and which group owns the ptys. */
static int apply_places(struct sim_config *config, struct options *options)
{
	const struct group *group = options->group_name ? getgrnam(options->group_name) : NULL;

	for (size_t i = 0; i < options->link_count; i++) {
		char *path = strchr(options->links[i], '=');
		bool found = false;

		for (size_t j = 0; path && j < config->bus_count; j++) {
			size_t length = (size_t)(path - options->links[i]);

			if (strncmp(config->buses[j].name, options->links[i], length) != 0 ||
			    config->buses[j].name[length] != '\0')
				continue;
			config->buses[j].link = path + 1;
			found = true;
		}
		if (!found) {
			fprintf(stderr, "--link %s: right is BUS=PATH with a bus of %s\n",
			        options->links[i],
			        options->config ? options->config : "--replay, which is replay");
			return -1;
		}
	}
	if (options->group_name && !group) {
		fprintf(stderr, "--pty-group %s: there is no such group\n", options->group_name);
		return -1;
	}
	if (group)
		options->group = group->gr_gid;
	for (size_t i = 0; i < config->bus_count; i++) {
		config->buses[i].folder = options->folder;
		config->buses[i].group = group ? &options->group : NULL;
	}
	return 0;
}

static int watch(const struct loop *loop, int fd, void *data)
{
	struct epoll_event event = { .events = EPOLLIN, .data.ptr = data };

	return epoll_ctl(loop->poll, EPOLL_CTL_ADD, fd, &event);
}

static int open_loop(struct loop *loop)
{
	sigset_t set;

	(void)sigemptyset(&set);
	(void)sigaddset(&set, SIGTERM);
	(void)sigaddset(&set, SIGINT);
	if (sigprocmask(SIG_BLOCK, &set, NULL) != 0)
		return -1;
	/* Replies are timed to the byte; the default slack of 50 us would show at high rates. */
	(void)prctl(PR_SET_TIMERSLACK, 1UL, 0UL, 0UL, 0UL);
	loop->armed = DB_TIME_NEVER;
	loop->poll = epoll_create1(EPOLL_CLOEXEC);
	loop->timer = timerfd_create(CLOCK_MONOTONIC, TFD_NONBLOCK | TFD_CLOEXEC);
	loop->signals = signalfd(-1, &set, SFD_NONBLOCK | SFD_CLOEXEC);
	if (loop->poll < 0 || loop->timer < 0 || loop->signals < 0)
		return -1;
	return watch(loop, loop->timer, &loop->timer) != 0 ||
	                       watch(loop, loop->signals, &loop->signals) != 0 ?
	               -1 :
	               0;
}

/* 0 after a signal to end, -1 after an error. */
static int run(struct loop *loop, struct sim_world *world, struct sim_control *control, bool busy)
{
	struct epoll_event events[16];
	uint64_t ticks;

	for (;;) {
		db_time next = busy ? loop->armed : sim_world_next(world, clock_now());
		int count;

		if (next != loop->armed) {
			struct itimerspec setting = { .it_value = { 0, 0 } };

			if (next != DB_TIME_NEVER) {
				setting.it_value.tv_sec = next / DB_NS_PER_S;
				setting.it_value.tv_nsec = next % DB_NS_PER_S;
			}
			(void)timerfd_settime(loop->timer, TFD_TIMER_ABSTIME, &setting, NULL);
			loop->armed = next;
		}
		count = epoll_wait(loop->poll, events, 16, busy ? 0 : -1);
		if (count < 0 && errno != EINTR)
			return -1;
		for (int i = 0; i < count; i++) {
			struct sim_bus *bus = events[i].data.ptr;
			int result = 0;

			if (events[i].data.ptr == &loop->signals)
				return 0;
			if (events[i].data.ptr == &loop->timer) {
				if (read(loop->timer, &ticks, sizeof(ticks)) > 0)
					loop->armed = DB_TIME_NEVER;
			} else if (events[i].data.ptr == control) {
				sim_control_run(control, clock_now());
			} else {
				result = sim_bus_read(bus, clock_now());
			}
			if (result != 0) {
				fprintf(stderr, "bus %s: %s: %s\n", bus->config->name,
				        bus->port.host, strerror(-result));
				return -1;
			}
		}
		sim_world_run(world, clock_now());
	}
}

static int simulate(const struct sim_config *config, const struct options *options, FILE *trace)
{
	struct loop loop = { .poll = -1, .timer = -1, .signals = -1 };
	struct sim_world world = { .buses = NULL };
	struct sim_control *control = NULL;
	int result = -1;
	int control_fd;

	if (open_loop(&loop) != 0) {
		fprintf(stderr, "drivebridge-sim: %s\n", strerror(errno));
		goto out;
	}
	if (sim_world_open(&world, config, trace, clock_now()) != 0)
		goto out;
	if (options->control) {
		control_fd = sim_control_open(options->control, &world, &control);
		if (control_fd < 0) {
			fprintf(stderr, "control socket %s: %s\n", options->control,
			        strerror(-control_fd));
			goto out;
		}
		if (watch(&loop, control_fd, control) != 0)
			goto out;
	}
	for (size_t i = 0; i < world.bus_count; i++) {
		struct sim_bus *bus = &world.buses[i];

		if (watch(&loop, bus->port.fd, bus) != 0)
			goto out;
		printf("bus %s on %s\n", bus->config->name, bus->port.host);
	}
	puts("ready");
	if (fflush(stdout) == 0)
		result = run(&loop, &world, control, options->busy);
	if (result == 0 && options->replay) {
		sim_replay_report(world.buses[0].wire);
		result = sim_replay_is_complete(world.buses[0].wire) ? 0 : -1;
	}
out:
	sim_control_close(control);
	sim_world_close(&world);
	if (loop.poll >= 0)
		(void)close(loop.poll);
	if (loop.timer >= 0)
		(void)close(loop.timer);
	if (loop.signals >= 0)
		(void)close(loop.signals);
	return result;
}

int main(int argc, char **argv)
{
	struct options options = { .config = NULL };
	struct sim_config config;
	FILE *trace = NULL;
	int result = read_options(argc, argv, &options);

	if (result != 0)
		return result - 1;
	if (options.replay) {
		/* A configuration of one line that only replays a trace. */
		config = (struct sim_config){ .bus_count = 1 };
		config.buses = calloc(1, sizeof(*config.buses));
		if (!config.buses)
			return EXIT_FAILURE;
		config.buses[0] = (struct sim_bus_config){
			.name = "replay",
			.kind = SIM_BUS_VSMD_SERIAL,
			.device = "pty",
			.replay = options.replay,
			.serial.baud = 115200,
		};
	} else if (sim_config_load(options.config, &config) != 0) {
		return EXIT_FAILURE;
	}
	result = apply_places(&config, &options);
	if (result == 0 && options.trace) {
		trace = fopen(options.trace, "we");
		if (!trace) {
			fprintf(stderr, "%s: %s\n", options.trace, strerror(errno));
			result = -1;
		} else {
			(void)setvbuf(trace, NULL, _IOLBF, 0);
		}
	}
	if (result == 0)
		result = simulate(&config, &options, trace);
	if (trace)
		(void)fclose(trace);
	sim_config_free(&config);
	return result == 0 ? EXIT_SUCCESS : EXIT_FAILURE;
}
