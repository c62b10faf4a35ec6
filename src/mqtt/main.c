/* SPDX-License-Identifier: Apache-2.0 */
/*
 * drivebridge-mqtt: drives' values to a broker of MQTT, and commands from there where that is allowed. A client of the
 * control socket of drivebridged and of nothing else.
 */
#include "client/log.h"
#include "drivebridge/version.h"
#include "mqtt/publisher.h"

#include <errno.h>
#include <getopt.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <sys/signalfd.h>
#include <systemd/sd-daemon.h>
#include <time.h>
#include <unistd.h>

#define CONFIG_PATH "/etc/drivebridge/mqtt.conf"

/* From sysexits.h: the unit's RestartPreventExitStatus. */
#define EXIT_CONFIG 78

/* The loop goes around at least so often, for the watchdog of systemd. */
#define TURN_MAX (1 * DB_NS_PER_S)

struct options {
	const char *config;
	bool check;
};

static void print_usage(FILE *out)
{
	(void)fputs("usage: drivebridge-mqtt [--config FILE] [--check]\n"
	            "  --config FILE  what to publish where; " CONFIG_PATH " when not given\n"
	            "  --check        check the file and end\n"
	            "  --help, --version\n",
	            out);
}

/* -1 to go on, else the status to exit with. */
static int read_options(int argc, char **argv, struct options *options)
{
	static const struct option known[] = {
		{ "config", required_argument, NULL, 'c' },
		{ "check", no_argument, NULL, 'k' },
		{ "help", no_argument, NULL, 'h' },
		{ "version", no_argument, NULL, 'v' },
		{ NULL, 0, NULL, 0 },
	};
	int option;

	while ((option = getopt_long(argc, argv, "", known, NULL)) != -1) {
		if (option == 'c') {
			options->config = optarg;
		} else if (option == 'k') {
			options->check = true;
		} else if (option == 'v') {
			(void)puts("drivebridge-mqtt " DB_VERSION);
			return EXIT_SUCCESS;
		} else {
			print_usage(option == 'h' ? stdout : stderr);
			return option == 'h' ? EXIT_SUCCESS : 2;
		}
	}
	if (optind == argc)
		return -1;
	print_usage(stderr);
	return 2;
}

static db_time read_clock(void)
{
	struct timespec time;

	(void)clock_gettime(CLOCK_MONOTONIC, &time);
	return (db_time)time.tv_sec * DB_NS_PER_S + time.tv_nsec;
}

static int64_t read_calendar(void)
{
	struct timespec time;

	(void)clock_gettime(CLOCK_REALTIME, &time);
	return (int64_t)time.tv_sec * 1000000 + time.tv_nsec / 1000;
}

/* Until a signal ends it. */
static int run(struct db_mqtt_publisher *publisher)
{
	struct pollfd fds[DB_MQTT_PUBLISHER_FDS + 1] = { { .fd = -1 } };
	sigset_t set;
	int signals;

	(void)sigemptyset(&set);
	(void)sigaddset(&set, SIGTERM);
	(void)sigaddset(&set, SIGINT);
	(void)sigprocmask(SIG_BLOCK, &set, NULL);
	signals = signalfd(-1, &set, SFD_NONBLOCK | SFD_CLOEXEC);
	if (signals < 0) {
		db_client_log(DB_CLIENT_ERROR, "signalfd: %s", strerror(errno));
		return EXIT_FAILURE;
	}
	(void)sd_notify(0, "READY=1");
	for (;;) {
		db_time wait = db_mqtt_publisher_due(publisher) - read_clock();

		db_mqtt_publisher_watch(publisher, fds + 1);
		fds[0] = (struct pollfd){ .fd = signals, .events = POLLIN };
		wait = wait < 0 ? 0 : wait > TURN_MAX ? TURN_MAX : wait;
		if (poll(fds, sizeof(fds) / sizeof(fds[0]),
		         (int)((wait + DB_NS_PER_MS - 1) / DB_NS_PER_MS)) < 0 &&
		    errno != EINTR)
			break;
		if (fds[0].revents != 0)
			break;
		db_mqtt_publisher_handle(publisher, fds + 1, read_clock(), read_calendar());
		(void)sd_notify(0, "WATCHDOG=1");
	}
	(void)sd_notify(0, "STOPPING=1");
	(void)close(signals);
	return EXIT_SUCCESS;
}

int main(int argc, char **argv)
{
	struct options options = { .config = CONFIG_PATH };
	struct db_mqtt_publisher *publisher;
	struct db_mqtt_config config;
	char host[64] = "gateway";
	int status = read_options(argc, argv, &options);

	if (status >= 0)
		return status;
	(void)gethostname(host, sizeof(host) - 1);
	if (!db_mqtt_config_load(options.config, host, stderr, &config)) {
		db_mqtt_config_free(&config);
		return EXIT_CONFIG;
	}
	if (options.check) {
		(void)printf("%s: it is good\n", options.config);
		db_mqtt_config_free(&config);
		return EXIT_SUCCESS;
	}
	/* A name server that is away must not keep us from the service for long: it drops who does not read. */
	(void)setenv("RES_OPTIONS", "timeout:1 attempts:1", 0);
	(void)signal(SIGPIPE, SIG_IGN);
	srand((unsigned)(read_calendar() ^ getpid()));
	publisher = db_mqtt_publisher_new(&config);
	if (publisher)
		status = run(publisher);
	else
		db_client_log(DB_CLIENT_ERROR, "out of memory");
	db_mqtt_publisher_free(publisher);
	db_mqtt_config_free(&config);
	return publisher ? status : EXIT_FAILURE;
}
