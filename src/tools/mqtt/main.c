/* SPDX-License-Identifier: Apache-2.0 */
/*
 * drivebridge-mqtt: publishes drives' values to an MQTT broker, and takes commands from there if
 * allowed. It is a client of the control socket of drivebridged and of nothing else.
 */
#include "certificates/pair.h"
#include "client/clock.h"
#include "client/log.h"
#include "client/program.h"
#include "mqtt/publisher.h"

#include <stdlib.h>

#define CONFIG_PATH "/etc/drivebridge/mqtt.conf"

static int serve(const void *config, sd_event *loop)
{
	struct db_mqtt_publisher *publisher;
	int status = EXIT_FAILURE;

	/* An unreachable name server must not block for long: the service disconnects clients that
	 * do not read. */
	(void)setenv("RES_OPTIONS", "timeout:1 attempts:1", 0);
	publisher = db_mqtt_publisher_new(loop, config);
	if (publisher)
		status = db_program_loop(loop, db_mqtt_publisher_turn, db_mqtt_publisher_renew,
		                         publisher);
	else
		db_client_log(DB_CLIENT_ERROR, "it cannot be started");
	db_mqtt_publisher_free(publisher);
	return status;
}

static bool check_files(const void *values)
{
	const struct db_mqtt_config *config = values;

	return !config->tls || !config->certificate_file[0] ||
	       db_certificate_pair_check(config->certificate_file, config->key_file,
	                                 db_client_wall_us() / 1000000, stderr);
}

int main(int argc, char **argv)
{
	const struct db_program program = {
		.name = "drivebridge-mqtt",
		.path = CONFIG_PATH,
		.usage = "usage: drivebridge-mqtt [--config FILE] [--check]\n"
			 "  --config FILE  what to publish where; " CONFIG_PATH " when not given\n"
			 "  --check        check the file and the certificate, and end\n"
			 "  --help, --version\n",
		.form = &db_mqtt_form,
		.check = check_files,
		.serve = serve,
	};

	return db_program_main(&program, argc, argv);
}
