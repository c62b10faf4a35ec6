/* SPDX-License-Identifier: Apache-2.0 */
/*
 * How long a stop takes by a method of OPC UA and by a write over Modbus, each from a client in C that is connected
 * already; the one of OPC UA signs and encrypts.
 *
 *   opcua_stop URL CERTIFICATE KEY URI USER PASSWORD HOST PORT UNIT DRIVE ADDRESS CODE
 *
 * For each line of standard input, "method" or "Modbus", stops the drive so, or for "read" reads the server's state, and
 * prints the milliseconds until the answer was there. CODE is written to ADDRESS, the register `command`.
 */
#include <errno.h>
#include <modbus.h>
#include <open62541/client.h>
#include <open62541/client_config_default.h>
#include <open62541/client_highlevel.h>
#include <open62541/plugin/log_stdout.h>
#include <open62541/plugin/pki_default.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define POLICY "http://opcfoundation.org/UA/SecurityPolicy#Basic256Sha256"

static _Noreturn void fail(const char *what, const char *why)
{
	(void)fprintf(stderr, "opcua_stop: %s: %s\n", what, why);
	exit(EXIT_FAILURE);
}

static void check(UA_StatusCode status, const char *what)
{
	if (status != UA_STATUSCODE_GOOD)
		fail(what, UA_StatusCode_name(status));
}

static double milliseconds(void)
{
	struct timespec t;

	(void)clock_gettime(CLOCK_MONOTONIC, &t);
	return 1000.0 * (double)t.tv_sec + (double)t.tv_nsec / 1e6;
}

static UA_ByteString read_file(const char *path)
{
	FILE *file = fopen(path, "rb");
	UA_ByteString bytes;

	check(UA_ByteString_allocBuffer(&bytes, 65536), path);
	if (!file)
		fail(path, "cannot be read");
	bytes.length = fread(bytes.data, 1, bytes.length, file);
	(void)fclose(file);
	return bytes;
}

static UA_Client *connect_opcua(char **arguments)
{
	UA_Client *client = UA_Client_new();
	UA_ClientConfig *config = UA_Client_getConfig(client);

	config->logging->clear(config->logging);
	config->logging = UA_Log_Stdout_new(UA_LOGLEVEL_ERROR);
	check(UA_ClientConfig_setDefaultEncryption(config, read_file(arguments[1]),
	                                           read_file(arguments[2]), NULL, 0, NULL, 0),
	      "security");
	/* What is measured runs on this machine. */
	UA_CertificateVerification_AcceptAll(&config->certificateVerification);
	config->securityMode = UA_MESSAGESECURITYMODE_SIGNANDENCRYPT;
	config->securityPolicyUri = UA_STRING_ALLOC(POLICY);
	UA_String_clear(&config->clientDescription.applicationUri);
	config->clientDescription.applicationUri = UA_STRING_ALLOC(arguments[3]);
	check(UA_Client_connectUsername(client, arguments[0], arguments[4], arguments[5]),
	      "connection");
	return client;
}

static modbus_t *connect_modbus(char **arguments)
{
	modbus_t *modbus = modbus_new_tcp_pi(arguments[0], arguments[1]);

	if (!modbus || modbus_set_slave(modbus, atoi(arguments[2])) != 0 ||
	    modbus_connect(modbus) != 0)
		fail("Modbus", "no connection");
	return modbus;
}

static void call_stop(UA_Client *client, const char *drive, UA_UInt16 space)
{
	char name[128];
	UA_NodeId object;
	UA_NodeId method;
	UA_Variant *output;
	size_t count;

	(void)snprintf(name, sizeof(name), "%s.Stop", drive);
	method = UA_NODEID_STRING_ALLOC(space, name);
	object = UA_NODEID_STRING_ALLOC(space, drive);
	check(UA_Client_call(client, object, method, 0, NULL, &count, &output), "Stop");
	UA_Array_delete(output, count, &UA_TYPES[UA_TYPES_VARIANT]);
	UA_NodeId_clear(&object);
	UA_NodeId_clear(&method);
}

static void read_state(UA_Client *client)
{
	UA_Variant value;

	check(UA_Client_readValueAttribute(
		      client, UA_NODEID_NUMERIC(0, UA_NS0ID_SERVER_SERVERSTATUS_STATE), &value),
	      "read");
	UA_Variant_clear(&value);
}

int main(int argc, char **argv)
{
	UA_String space_name = UA_STRING("urn:gw:drivebridge:drives");
	UA_UInt16 space;
	UA_Client *client;
	modbus_t *modbus;
	char line[32];

	if (argc != 13)
		fail("usage", "see its source");
	client = connect_opcua(argv + 1);
	modbus = connect_modbus(argv + 7);
	check(UA_Client_NamespaceGetIndex(client, &space_name, &space), "namespace");
	while (fgets(line, sizeof(line), stdin)) {
		double begun = milliseconds();

		if (strcmp(line, "method\n") == 0)
			call_stop(client, argv[10], space);
		else if (strcmp(line, "read\n") == 0)
			read_state(client);
		else if (modbus_write_register(modbus, atoi(argv[11]), (uint16_t)atoi(argv[12])) !=
		         1)
			fail("Modbus", modbus_strerror(errno));
		(void)printf("%.3f\n", milliseconds() - begun);
		(void)fflush(stdout);
	}
	modbus_close(modbus);
	modbus_free(modbus);
	UA_Client_delete(client);
	return EXIT_SUCCESS;
}
