/* SPDX-License-Identifier: Apache-2.0 */
#include "tls/config.h"

#include <arpa/inet.h>

/* Its members may read the key. */
#define GROUP "drivebridge-tls"

static void check_whole(struct db_settings *settings, const void *context)
{
	const struct db_tls_config *config = settings->values;
	unsigned char bytes[16];

	(void)context;
	db_settings_check_secret(settings, "certificates", "key-file", config->key_file, GROUP);
	if (config->address[0] != '\0' && inet_pton(AF_INET, config->address, bytes) != 1 &&
	    inet_pton(AF_INET6, config->address, bytes) != 1)
		db_messages_add_error(
			settings->messages, db_settings_line(settings, "server", "address"),
			"address = %s is no address; \"192.168.10.2\" or \"fd00::2\", "
			"numbers only, for instance",
			config->address);
}

const struct db_settings_form db_tls_form = {
	.keys = db_tls_keys,
	.sections = "service, server and certificates",
	.size = sizeof(struct db_tls_config),
	.check = check_whole,
};
