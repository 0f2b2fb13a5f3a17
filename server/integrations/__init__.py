"""Other systems that hear what the site sees: webhooks and MQTT. They use the façade of the service."""
