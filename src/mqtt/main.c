/* SPDX-License-Identifier: Apache-2.0 */
/*
 * drivebridge-mqtt: drives' values to a broker of MQTT, and commands from there where that is allowed. A client of the
 * control socket of drivebridged and of nothing else.
 */
#include "client/clock.h"
#include "client/log.h"
#include "client/options.h"
#include "mqtt/publisher.h"

#include <errno.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <sys/signalfd.h>
#include <systemd/sd-daemon.h>
#include <unistd.h>

#define CONFIG_PATH "/etc/drivebridge/mqtt.conf"

/* The loop goes around at least so often, for the watchdog of systemd. */
#define TURN_MAX (1 * DB_NS_PER_S)

static const char usage[] = "usage: drivebridge-mqtt [--config FILE] [--check]\n"
			    "  --config FILE  what to publish where; " CONFIG_PATH
			    " when not given\n"
			    "  --check        check the file and end\n"
			    "  --help, --version\n";

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
		db_time wait = db_mqtt_publisher_due(publisher) - db_client_now();

		db_mqtt_publisher_watch(publisher, fds + 1);
		fds[0] = (struct pollfd){ .fd = signals, .events = POLLIN };
		wait = wait < 0 ? 0 : wait > TURN_MAX ? TURN_MAX : wait;
		if (poll(fds, sizeof(fds) / sizeof(fds[0]),
		         (int)((wait + DB_NS_PER_MS - 1) / DB_NS_PER_MS)) < 0 &&
		    errno != EINTR)
			break;
		if (fds[0].revents != 0)
			break;
		db_mqtt_publisher_handle(publisher, fds + 1, db_client_now(), db_client_wall_us());
		(void)sd_notify(0, "WATCHDOG=1");
	}
	(void)sd_notify(0, "STOPPING=1");
	(void)close(signals);
	return EXIT_SUCCESS;
}

int main(int argc, char **argv)
{
	const char *path = CONFIG_PATH;
	bool check = false;
	const struct db_client_option options[] = {
		{ .name = "config", .text = &path },
		{ .name = "check", .flag = &check },
		{ .name = NULL },
	};
	struct db_mqtt_publisher *publisher;
	struct db_mqtt_config config;
	char host[64] = "gateway";
	int status = db_client_options_read("drivebridge-mqtt", usage, options, argc, argv);

	if (status >= 0)
		return status;
	(void)gethostname(host, sizeof(host) - 1);
	if (!db_mqtt_config_load(path, host, stderr, &config)) {
		db_mqtt_config_free(&config);
		return DB_CLIENT_EXIT_CONFIG;
	}
	if (check) {
		(void)printf("%s: it is good\n", path);
		db_mqtt_config_free(&config);
		return EXIT_SUCCESS;
	}
	/* A name server that is away must not keep us from the service for long: it drops who does not read. */
	(void)setenv("RES_OPTIONS", "timeout:1 attempts:1", 0);
	(void)signal(SIGPIPE, SIG_IGN);
	srand((unsigned)(db_client_wall_us() ^ getpid()));
	publisher = db_mqtt_publisher_new(&config);
	if (publisher)
		status = run(publisher);
	else
		db_client_log(DB_CLIENT_ERROR, "out of memory");
	db_mqtt_publisher_free(publisher);
	db_mqtt_config_free(&config);
	return publisher ? status : EXIT_FAILURE;
}
